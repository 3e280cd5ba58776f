// A simulated hand on the first pad. It runs in the worker of the socket, so that its strokes stay even while the page
// is busy.
const WHO = "demo";

export class DemoHand {
    #hands;
    #connection;

    constructor(hands, connection) {
        this.#hands = hands;
        this.#connection = connection;
        connection.on("stroked", (samples) => hands.move(WHO, samples));
        connection.on("lost", () => this.stop());
    }

    get running() {
        return this.#hands.down.some((hand) => hand.who === WHO);
    }

    start() {
        const guided = this.#hands.guide(WHO, () => this.#connection.stroke(null));
        if (guided) this.press();
    }

    stop() {
        this.#hands.lift(WHO);
    }

    // Takes the force of the slider.
    press() {
        this.#connection.stroke({ pad: this.#hands.pads[0], force_n: this.#hands.force_n });
    }
}
