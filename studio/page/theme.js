// Colours for drawing on canvases, and canvases that follow their size.
const dark = matchMedia("(prefers-color-scheme: dark)");
const NAMES = [
    "paper",
    "panel",
    "box",
    "ink",
    "soft",
    "faint",
    "grid",
    "axis",
    "frame",
    "accent",
    "warn",
    "bad",
    "good",
    ...[0, 1, 2, 3, 4, 5, 6].flatMap((i) => [`ink${i}`, `tint${i}`]),
];
export const FONT = "11px system-ui, -apple-system, 'Segoe UI', 'DejaVu Sans', sans-serif";
export const FONT_STRONG = FONT.replace("11px", "600 12px");

// The colours of the current theme, by name.
export const colours = {};

function load() {
    const style = getComputedStyle(document.documentElement);
    for (const name of NAMES) colours[name] = style.getPropertyValue(`--${name}`).trim();
}

load();
const listeners = new Set();
dark.addEventListener("change", () => {
    load();
    for (const listener of listeners) listener();
});

// Calls `listener` whenever the theme changes; returns a function that ends this.
export function onTheme(listener) {
    listeners.add(listener);
    return () => listeners.delete(listener);
}

// A canvas whose pixels follow its size on the page; `resized` is called after each change.
export class Surface {
    constructor(canvas, resized = () => {}) {
        this.canvas = canvas;
        this.context = canvas.getContext("2d");
        this.width = this.height = 0;
        this.figure = null; // the context of a figure, which is drawn in place of the canvas
        this.observer = new ResizeObserver(() => {
            this.#fit();
            resized();
        });
        this.observer.observe(canvas);
        this.#fit();
    }

    // The context, cleared, in CSS pixels; null while the canvas is not shown.
    begin() {
        if (this.figure || this.width === 0 || this.height === 0) return this.figure;
        this.context.setTransform(this.ratio, 0, 0, this.ratio, 0, 0);
        this.context.clearRect(0, 0, this.width, this.height);
        this.context.font = FONT;
        return this.context;
    }

    end() {
        this.observer.disconnect();
    }

    #fit() {
        this.ratio = Math.min(window.devicePixelRatio || 1, 2.5);
        this.width = this.canvas.clientWidth;
        this.height = this.canvas.clientHeight;
        const [w, h] = [Math.round(this.width * this.ratio), Math.round(this.height * this.ratio)];
        if (this.canvas.width !== w) this.canvas.width = w;
        if (this.canvas.height !== h) this.canvas.height = h;
    }
}

// Text with a halo in the background's colour, so that it is readable over curves.
export function haloText(context, text, x, y, colour, ground) {
    context.lineWidth = 3;
    context.lineJoin = "round";
    context.strokeStyle = ground;
    context.strokeText(text, x, y);
    context.fillStyle = colour;
    context.fillText(text, x, y);
}
