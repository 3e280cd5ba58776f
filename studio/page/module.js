// The engine as a WebAssembly module: its calls under descriptive names, over its own memory. It runs in audio
// threads, which cannot turn text into bytes, so all text here is UTF-8 already.
const TEXT = 1;

export class Module {
    #calls;

    constructor(wasm) {
        this.#calls = new WebAssembly.Instance(new WebAssembly.Module(wasm), {}).exports;
    }

    // Adds a file ({ path, bytes }) that graphs use.
    put({ path, bytes }) {
        this.#fill(path, bytes);
        this.#calls.haptograph_file(path.length);
    }

    // Begins to run a graph, or a study ({ file, set } as JSON); throws its errors, as bytes.
    open(opened, isStudy = false) {
        this.#tellTime();
        this.#fill(opened);
        const { haptograph_open, haptograph_open_study } = this.#calls;
        if (!(isStudy ? haptograph_open_study : haptograph_open)()) throw this.#message();
    }

    // The same for an engine that only checks edits.
    openChecker(opened) {
        this.#fill(opened);
        if (!this.#calls.haptograph_open_checker()) throw this.#message();
    }

    // Takes a message of a page: 0, or 1 for a study's participant.
    hear({ bytes, text }, page) {
        this.#tellTime();
        this.#fill(new Uint8Array(bytes));
        this.#calls.haptograph_hear(page, text ? 1 : 0);
    }

    // Lets the page of a study's participant in, or says that it is gone.
    letParticipant(isThere) {
        this.#calls.haptograph_participant(isThere ? 1 : 0);
    }

    // The files of a study that were written since the last time, { path, bytes }; those that were removed have no bytes.
    *changes() {
        for (let kind = this.#calls.haptograph_changed(); kind; kind = this.#calls.haptograph_changed()) {
            const path = this.#message();
            const content = this.#calls.haptograph_room_length();
            yield kind === 1 ? { path } : { path, bytes: this.#copy(this.#calls.haptograph_room(content), content) };
        }
    }

    // The answer to a message that asks for a check or a wrong edit; null if the engine has to answer.
    check(message) {
        this.#fill(message);
        return this.#calls.haptograph_check() ? this.#message() : null;
    }

    // Learns the surface of a recording, { path, bytes, mapping }, or says what reading it finds; returns the result as JSON. Throws
    // its errors, as bytes.
    learn(recording, reads) {
        this.put(recording);
        this.#fill(recording.path, recording.mapping);
        const isLearned = this.#calls[reads ? "haptograph_read" : "haptograph_learn"](recording.path.length);
        if (!isLearned) throw this.#message();
        return this.#message();
    }

    // The answer to a message that asks to listen to a recording beside surfaces of a graph, which begins as in an engine that checks
    // edits.
    listen(recording, { files, opened, surfaces, message }) {
        for (const file of [...files, recording]) this.put(file);
        this.openChecker(opened);
        for (const surface of surfaces) this.addSurface(surface);
        this.#fill(message);
        if (!this.#calls.haptograph_listen()) throw new Error("the engine does not know this message");
        return this.#message();
    }

    // The answer to a message that asks for a file of sound.
    export(message) {
        this.#fill(message);
        if (!this.#calls.haptograph_export()) throw new Error("the engine does not know this message");
        return this.#message();
    }

    // Puts a new surface beside the graph's others, { name, text }; returns its path as a parameter. For a module that
    // checks edits. Null if the surface cannot be named.
    addSurface({ name, text }) {
        this.#fill(name, text);
        return this.#calls.haptograph_surface(name.length) ? this.#message() : null;
    }

    // Updates the running graph, against which edits are checked, from the engine's message.
    follow(message) {
        this.#fill(message);
        this.#calls.haptograph_follow();
    }

    // Runs so many frames of the driver; returns the played samples as a view that is valid until the next call.
    process(frames) {
        const count = this.#calls.haptograph_process(frames);
        return new Float64Array(this.#calls.memory.buffer, this.#calls.haptograph_played(), count);
    }

    publish(passed_ms, busy_ms) {
        this.#tellTime();
        this.#calls.haptograph_publish(passed_ms, busy_ms);
    }

    // The messages to a page since the last time, { bytes, text }.
    *messages(page) {
        for (let kind = this.#calls.haptograph_next(page); kind; kind = this.#calls.haptograph_next(page))
            yield { bytes: this.#message().buffer, text: kind === TEXT };
    }

    get driver_hz() {
        return this.#calls.haptograph_driver_hz();
    }

    // 0 if there is no sound.
    get sound_hz() {
        return this.#calls.haptograph_sound_hz();
    }

    get memory_bytes() {
        return this.#calls.memory.buffer.byteLength;
    }

    // The reason why the module ended, as bytes; empty while it runs.
    get panic() {
        return this.#copy(this.#calls.haptograph_panic(), this.#calls.haptograph_panic_length());
    }

    #tellTime() {
        this.#calls.haptograph_clock(Date.now());
    }

    #fill(...parts) {
        const length = parts.reduce((sum, part) => sum + part.length, 0);
        let at = this.#calls.haptograph_room(length);
        for (const part of parts) {
            new Uint8Array(this.#calls.memory.buffer, at, part.length).set(part);
            at += part.length;
        }
    }

    #message() {
        return this.#copy(this.#calls.haptograph_message(), this.#calls.haptograph_message_length());
    }

    #copy(at, length) {
        return new Uint8Array(this.#calls.memory.buffer, at, length).slice();
    }
}
