// A source of events.
export class Emitter {
    #listeners = new Map();

    // Calls `listener` with the value of every `type` from now on; returns a function that ends this.
    on(type, listener) {
        if (!this.#listeners.has(type)) this.#listeners.set(type, new Set());
        this.#listeners.get(type).add(listener);
        return () => this.#listeners.get(type).delete(listener);
    }

    emit(type, value) {
        for (const listener of this.#listeners.get(type) ?? []) {
            try {
                listener(value);
            } catch (error) {
                reportError(error); // the others still have to know
            }
        }
    }
}
