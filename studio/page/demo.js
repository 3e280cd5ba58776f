// Simulated hands on all pads, and on the inputs that nobody holds. They run in the worker of the socket, with exact times, so
// that their strokes stay even while the page is busy.
const WHO = "demo";

export class DemoHand {
    #hands;
    #connection;
    running = false;
    gesture = "circles";

    constructor(hands, connection) {
        this.#hands = hands;
        this.#connection = connection;
        hands.onpress = () => this.stop();
        connection.on("stroked", ({ number, samples }) => this.running && hands.show(WHO, number, samples));
        connection.on("lost", () => this.stop());
    }

    start() {
        const hands = this.#hands.free();
        if (hands.length === 0 || !this.#hands.allowed()) return;
        this.running = true;
        this.#connection.stroke({ hands, gesture: this.gesture, force_n: this.#hands.force_n });
    }

    stop() {
        if (!this.running) return;
        this.running = false;
        this.#hands.hide(WHO);
        this.#connection.stroke(null);
    }

    // Takes the gesture and the force of the slider.
    change() {
        if (this.running) this.#connection.stroke({ gesture: this.gesture, force_n: this.#hands.force_n });
    }
}
