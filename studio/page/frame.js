// The loop for all drawing: at every frame while the page is visible. On a slow machine, drawers that can wait run at
// every second frame, half of them at each.
const FULL_RATE_HZ = 48;
const drawers = new Set();
let turns = 0;
let turn = 0;
let frames = 0;
let since_ms = performance.now();
let rate_hz = 60;

// Calls `draw(now_ms)` at every frame; returns a function that ends this.
export function everyFrame(draw) {
    drawers.add(draw);
    return () => drawers.delete(draw);
}

// The same for drawers that can wait.
export function mostFrames(draw) {
    const mine = turns++ % 2;
    return everyFrame((now_ms) => (rate_hz >= FULL_RATE_HZ || turn === mine) && draw(now_ms));
}

// Frames in the last second.
export const frameRate = () => rate_hz;

const failed = new Set();

// An error in a drawer is reported once and ends neither the others nor the loop.
function drawWith(draw, now_ms) {
    try {
        draw(now_ms);
    } catch (error) {
        if (!failed.has(draw)) reportError(error);
        failed.add(draw);
    }
}

function loop(now_ms) {
    requestAnimationFrame(loop);
    frames++;
    turn = 1 - turn;
    if (now_ms - since_ms >= 1000) {
        rate_hz = Math.round((1000 * frames) / (now_ms - since_ms));
        [frames, since_ms] = [0, now_ms];
    }
    for (const draw of drawers) drawWith(draw, now_ms);
}
requestAnimationFrame(loop);
