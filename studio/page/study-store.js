// What a study in this page keeps: its files, in the browser's own storage, and as an archive to download.
const DURABLE = { durability: "strict" };

export class StudyStore {
    #database;
    #isCleared = false;

    constructor(database) {
        this.#database = database;
    }

    // The store of a study at an address; an error if another window runs it.
    static async open(address) {
        const name = `haptograph-study ${address}`;
        const open = async () => {
            navigator.storage?.persist?.(); // a browser that is short of room removes others first
            const opening = indexedDB.open(name, 1);
            opening.onupgradeneeded = () => opening.result.createObjectStore("files");
            return new StudyStore(await result(opening));
        };
        return new Promise((done, failed) =>
            navigator.locks
                .request(name, { ifAvailable: true }, async (lock) => {
                    if (!lock) throw new Error("This study is open in another window of this browser: close that one, then reload this one.");
                    done(await open());
                    return new Promise(() => {}); // until the page closes
                })
                .catch(failed),
        );
    }

    async files() {
        const files = this.#database.transaction("files").objectStore("files");
        const [paths, contents] = await Promise.all([result(files.getAllKeys()), result(files.getAll())]);
        return paths.map((path, i) => ({ path, bytes: contents[i] }));
    }

    // Writes files, or removes those without bytes; all are on disk when this is done.
    async keep(changed) {
        if (this.#isCleared) return;
        const transaction = this.#database.transaction("files", "readwrite", DURABLE);
        const files = transaction.objectStore("files");
        for (const { path, bytes } of changed) bytes ? files.put(bytes, path) : files.delete(path);
        await complete(transaction);
    }

    // Removes all, and keeps nothing any more.
    async clear() {
        this.#isCleared = true;
        const transaction = this.#database.transaction("files", "readwrite", DURABLE);
        transaction.objectStore("files").clear();
        await complete(transaction);
    }
}

const result = (request) =>
    new Promise((done, failed) => {
        request.onsuccess = () => done(request.result);
        request.onerror = () => failed(request.error);
    });

const complete = (transaction) =>
    new Promise((done, failed) => {
        transaction.oncomplete = () => done();
        transaction.onabort = transaction.onerror = () => failed(transaction.error ?? new Error("the transaction was aborted"));
    });
