// One loop for all that is drawn: sixty times a second while the page is seen.
const drawers = new Set();
let frames = 0;
let since_ms = performance.now();
let rate_hz = 0;

// Calls `draw(now_ms)` at every frame; returns what ends that.
export function everyFrame(draw) {
    drawers.add(draw);
    return () => drawers.delete(draw);
}

// Frames in the last second.
export const frameRate = () => rate_hz;

function loop(now_ms) {
    frames++;
    if (now_ms - since_ms >= 1000) {
        rate_hz = Math.round((1000 * frames) / (now_ms - since_ms));
        [frames, since_ms] = [0, now_ms];
    }
    for (const draw of drawers) draw(now_ms);
    requestAnimationFrame(loop);
}
requestAnimationFrame(loop);
