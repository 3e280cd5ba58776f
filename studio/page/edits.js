// What an engine in the page runs, so that edits are checked beside it against the same: the checker takes an edit over
// before the engine has it, so it is told what runs where the engine refuses.
const EDITS = new Set(["apply", "parameter"]);

export class Edits {
    #tell;
    #runs = null; // { text, parameters }
    #pending = new Set(); // numbers of the requests that the engine has not answered

    // `tell(message)` hands a message to the checker as if a page had sent it.
    constructor(tell) {
        this.#tell = tell;
    }

    // Takes a message of the page that the checker passed on to the engine.
    sent({ type, request }) {
        if (EDITS.has(type)) this.#pending.add(request);
    }

    // Takes a message of the engine, as text.
    heard(text) {
        if (!/"type":"(graph|reply)"/.test(text)) return;
        const message = JSON.parse(text);
        if (message.type === "graph") this.#runs = message;
        else if (message.type === "reply" && this.#pending.delete(message.request) && !message.ok) this.#goBack();
    }

    #goBack() {
        for (const { name, value } of this.#runs?.parameters ?? []) this.#tell({ type: "parameter", request: 0, name, value });
        if (this.#runs) this.#tell({ type: "apply", request: 0, text: this.#runs.text });
    }
}
