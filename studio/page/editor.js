// The graph's own text: written with colours, completion and help, checked by the engine while it is edited, applied
// and saved.
import { saveBundle } from "./bundle.js";
import { find, make, setText } from "./dom.js";
import { completions, helpAt } from "./help.js";
import { prose } from "./prose.js";
import { ron } from "./ron-language.js";
import * as cm from "./vendor/codemirror.js";

const CHECK_AFTER_MS = 300;

export function mountEditor(studio) {
    const state = { view: null, engine: null, saved: true, timer: 0, asked: 0, note: null };
    const act = { apply: () => apply(studio, state), save: () => save(studio, state) };
    state.view = new cm.EditorView({
        parent: find("editor"),
        state: cm.EditorState.create({ doc: "", extensions: extensionsOf(studio, state, act) }),
    });
    find("editor-apply").addEventListener("click", act.apply);
    find("editor-save").addEventListener("click", act.save);
    find("editor-download").addEventListener("click", () => saveBundle(studio));
    find("editor-revert").addEventListener("click", () => replace(state, state.engine ?? ""));
    const take = (graph) => {
        const untouched = state.engine === null || textOf(state) === state.engine;
        [state.engine, state.saved] = [graph.text, graph.saved];
        if (untouched && textOf(state) !== graph.text) replace(state, graph.text, false);
        show(studio, state);
    };
    studio.on("graph", take);
    if (studio.graph) take(studio.graph);
    followDisk(studio, state, act);
    studio.editor = state.view;
    studio.edits = editsOf(studio, state);
    return act;
}

// What a hand does to the text outside of the editor; one thing after the other.
function editsOf(studio, state) {
    let turn = Promise.resolve();
    const inTurn = (run) => (turn = turn.then(run, run));
    return {
        text: () => textOf(state),
        isPending: () => textOf(state) !== state.engine,
        may: () => mayEdit(studio),
        change: (changesOf) => inTurn(() => change(studio, state, changesOf)),
        undo: (key) => inTurn(() => stepBack(studio, state, key)),
        apply: () => inTurn(() => apply(studio, state)),
        jump: (from, to) => {
            studio.showTab("editor");
            state.view.dispatch({ selection: { anchor: from, head: to }, scrollIntoView: true });
            state.view.focus();
        },
    };
}

const mayEdit = (studio) => studio.connection.open && studio.hello?.can.edit !== false && (studio.status?.owner ?? true);

// One step of the history of the editor, which is not typing and so joins no other.
const BY_HAND = "hand";

// Makes the changes that `changesOf` gives for the text, as one step of its history, and applies the text; beside changes that were not
// applied before, it is checked only. What is refused is undone. The reply has `isPending`, and `isKept` if the change stays.
async function change(studio, state, changesOf) {
    const before = textOf(state);
    const isPending = before !== state.engine;
    state.view.dispatch({ changes: changesOf(before), userEvent: BY_HAND });
    const text = textOf(state);
    if (text === before) return { ok: true, isPending, isKept: true };
    const checked = (asked) => studio.connection.request({ type: "check", text: asked });
    const reply = await (isPending ? checked(text) : apply(studio, state));
    // Errors that the text had before are not those of this change.
    const isKept = reply.ok || (isPending && studio.connection.open && !(await checked(before)).ok) || textOf(state) !== text;
    if (!isKept) run(state, "Mod-z");
    return { ...reply, isPending, isKept };
}

const run = (state, key) => cm.historyKeymap.find((each) => each.key === key).run(state.view);

// Undoes (`Mod-z`) or redoes (`Mod-y`) the latest change, and applies the text if what is undone was applied.
async function stepBack(studio, state, key) {
    const isPending = textOf(state) !== state.engine;
    if (!run(state, key) || isPending) return { ok: true };
    return apply(studio, state);
}

// Where another program changed the file, its text is applied; if the text here is changed too, a person decides.
function followDisk(studio, state, act) {
    let onDisk = null;
    const decide = (takes) => {
        find("disk").hidden = true;
        if (!takes) return studio.connection.send({ type: "keep" });
        replace(state, onDisk);
        act.apply();
    };
    studio.connection.on("disk", ({ text }) => {
        if (studio.status?.owner === false || text === textOf(state)) return;
        onDisk = text;
        // Nothing changes by itself under a hand that holds an armed actuator.
        const isChanged = textOf(state) !== state.engine || !state.saved || studio.status?.armed_gain > 0;
        if (!isChanged) return decide(true);
        find("disk").hidden = false;
        studio.say("warn", "Another program changed the graph's file: choose in the editor whose text runs");
    });
    find("disk-take").addEventListener("click", () => decide(true));
    find("disk-keep").addEventListener("click", () => decide(false));
}

// A diagnostic with its fields as the page uses them.
const plain = (diagnostic) => ({
    ...diagnostic,
    file: diagnostic.file ?? diagnostic.path ?? null,
    help: [diagnostic.help ?? []].flat().join("\n"),
});

const textOf = (state) => state.view.state.doc.toString();

// Replaces the text; a text from the engine does not enter the undo history.
function replace(state, text, undoable = true) {
    const annotations = cm.Transaction.addToHistory.of(undoable);
    state.view.dispatch({ changes: { from: 0, to: state.view.state.doc.length, insert: text }, annotations });
}

function extensionsOf(studio, state, act) {
    return [
        cm.lineNumbers(),
        cm.foldGutter(),
        cm.lintGutter(),
        cm.history(),
        cm.drawSelection(),
        cm.indentUnit.of("    "),
        cm.bracketMatching(),
        cm.closeBrackets(),
        cm.highlightActiveLine(),
        cm.highlightActiveLineGutter(),
        cm.highlightSelectionMatches(),
        cm.search({ top: true }),
        ron,
        cm.syntaxHighlighting(highlight),
        theme,
        cm.autocompletion({ override: [completions(studio)] }),
        cm.hoverTooltip((view, at) => tooltip(studio, view, at)),
        cm.keymap.of([
            { key: "Mod-Enter", run: () => (act.apply(), true) },
            { key: "Mod-s", run: () => (act.save(), true) },
            ...cm.closeBracketsKeymap,
            ...cm.completionKeymap,
            ...cm.lintKeymap,
            ...cm.searchKeymap,
            ...cm.historyKeymap,
            ...cm.foldKeymap,
            ...cm.defaultKeymap,
        ]),
        cm.EditorView.contentAttributes.of({ "aria-label": "The graph's text", tabindex: "0" }),
        cm.EditorView.updateListener.of((update) => {
            if (!update.docChanged) return;
            state.note = null;
            show(studio, state);
            studio.emit("text");
            clearTimeout(state.timer);
            state.timer = setTimeout(() => check(studio, state), CHECK_AFTER_MS);
        }),
    ];
}

function tooltip(studio, view, at) {
    const help = helpAt(studio, view.state.doc.toString(), at);
    return help && { pos: help.from, end: help.to, above: true, create: () => ({ dom: help.element }) };
}

// Requests the diagnostics of the text from the engine; a reply to an older text is ignored.
async function check(studio, state) {
    if (!studio.connection.open || studio.hello?.can.edit === false) return;
    const asked = ++state.asked;
    const reply = await studio.connection.request({ type: "check", text: textOf(state) });
    if (asked === state.asked) showProblems(studio, state, reply.diagnostics ?? []);
}

async function apply(studio, state) {
    const text = textOf(state);
    setText(find("editor-state"), "Applying…");
    state.asked++;
    const reply = await studio.connection.request({ type: "apply", text });
    showProblems(studio, state, reply.diagnostics ?? []);
    if (reply.ok) state.engine = text;
    const ms = typeof reply.ms === "number" ? ` (${Math.round(reply.ms)} ms)` : "";
    state.note = reply.ok
        ? `Applied: ${reply.change ?? "no change"}${ms}`
        : `Not applied, the sound goes on as before: ${reply.error}`;
    show(studio, state);
    return reply;
}

async function save(studio, state) {
    if (!find("disk").hidden) {
        state.note = "Not saved: choose first whose text is right";
        return show(studio, state);
    }
    const reply = await studio.connection.request({ type: "save", text: textOf(state) });
    state.note = reply.ok ? `Saved to ${studio.graph?.path ?? "the file"}` : `Not saved: ${reply.error}`;
    show(studio, state);
}

function show(studio, state) {
    const text = textOf(state);
    const applied = text === state.engine;
    const can = mayEdit(studio);
    find("editor-apply").disabled = applied || !can;
    find("editor-save").disabled = !studio.hello?.can.save || (applied && state.saved) || !can;
    find("editor-revert").disabled = applied;
    const says = !applied
        ? "Not applied yet: the previous text runs"
        : state.saved
          ? "The running graph is saved"
          : "The running graph is not saved";
    setText(find("editor-state"), state.note ? `${state.note}${applied && !state.saved ? ". Not saved" : ""}` : says);
    find("editor-state").title = find("editor-state").textContent;
}

function showProblems(studio, state, given) {
    const diagnostics = given.map(plain);
    const doc = state.view.state.doc;
    const own = ({ file }) => !file || baseName(file) === baseName(studio.graph?.path ?? file);
    const inline = diagnostics
        .filter((diagnostic) => own(diagnostic) && diagnostic.line)
        .map((diagnostic) => {
            const from = offset(doc, diagnostic.line, diagnostic.column);
            const to = Math.max(
                offset(doc, diagnostic.end_line ?? diagnostic.line, diagnostic.end_column ?? diagnostic.column),
                Math.min(from + 1, doc.length),
            );
            return {
                from,
                to,
                severity: severityOf(diagnostic),
                message: [diagnostic.message, diagnostic.help].filter(Boolean).join("\n"),
                source: diagnostic.code,
            };
        });
    state.view.dispatch(cm.setDiagnostics(state.view.state, inline));
    find("problems").replaceChildren(...diagnostics.map((diagnostic) => problem(state, diagnostic, own(diagnostic))));
}

const baseName = (path) => path.split(/[\\/]/).at(-1);
const severityOf = ({ severity }) => (["error", "warning", "info", "hint"].includes(severity) ? severity : "error");

// Lines and columns count from 1, columns in characters.
function offset(doc, line, column) {
    const at = doc.line(Math.max(1, Math.min(doc.lines, line)));
    return at.from + [...at.text].slice(0, Math.max(0, (column ?? 1) - 1)).join("").length;
}

function problem(state, diagnostic, own) {
    const where = diagnostic.line ? `${own ? "" : `${baseName(diagnostic.file)} `}${diagnostic.line}:${diagnostic.column}` : "";
    const go = () => {
        if (!own || !diagnostic.line) return;
        const at = offset(state.view.state.doc, diagnostic.line, diagnostic.column);
        state.view.dispatch({ selection: { anchor: at }, scrollIntoView: true });
        state.view.focus();
    };
    return make(
        "li",
        {},
        make(
            "button",
            { onclick: go },
            make("span", { class: "where", text: where }),
            make("span", { class: severityOf(diagnostic), text: `${severityOf(diagnostic)} ${diagnostic.code ?? ""} ` }),
            ...prose(diagnostic.message),
            diagnostic.help ? make("span", { class: "help" }, ...prose(diagnostic.help)) : null,
        ),
    );
}

const { tags } = cm;
const highlight = cm.HighlightStyle.define([
    { tag: [tags.lineComment, tags.blockComment], color: "var(--soft)", fontStyle: "italic" },
    { tag: tags.string, color: "var(--good)" },
    { tag: tags.labelName, color: "var(--ink3)", fontWeight: "600" },
    { tag: tags.number, color: "var(--warn)" },
    { tag: tags.atom, color: "var(--ink5)" },
    { tag: tags.typeName, color: "var(--ink0)", fontWeight: "600" },
    { tag: tags.propertyName, color: "var(--ink)" },
    { tag: [tags.bracket, tags.punctuation], color: "var(--soft)" },
]);
const theme = cm.EditorView.theme({
    "&": { color: "var(--ink)", backgroundColor: "var(--box)", fontSize: "13px" },
    ".cm-scroller": { fontFamily: "var(--mono)", lineHeight: "1.55" },
    ".cm-content": { caretColor: "var(--ink)" },
    ".cm-cursor": { borderLeftColor: "var(--ink)" },
    ".cm-gutters": { backgroundColor: "var(--panel)", color: "var(--soft)", border: "none" },
    ".cm-activeLine": { backgroundColor: "color-mix(in srgb, var(--tint0) 45%, transparent)" },
    ".cm-activeLineGutter": { backgroundColor: "var(--tint0)" },
    "&.cm-focused .cm-selectionBackground, .cm-selectionBackground": {
        backgroundColor: "color-mix(in srgb, var(--accent) 28%, transparent) !important",
    },
    ".cm-matchingBracket, &.cm-focused .cm-matchingBracket": {
        backgroundColor: "var(--tint2)",
        outline: "1px solid var(--ink2)",
    },
    ".cm-tooltip": {
        backgroundColor: "var(--box)",
        color: "var(--ink)",
        border: "1px solid var(--frame)",
        borderRadius: "8px",
        overflow: "hidden",
        boxShadow: "0 4px 18px rgb(0 0 0 / .25)",
    },
    ".cm-tooltip-autocomplete ul li[aria-selected]": { backgroundColor: "var(--accent)", color: "var(--on-accent)" },
    ".cm-tooltip-autocomplete ul": { fontFamily: "var(--mono)", fontSize: "12.5px" },
    ".cm-completionDetail": { color: "inherit", fontStyle: "normal" },
    ".cm-panels": { backgroundColor: "var(--panel)", color: "var(--ink)" },
    ".cm-panel input, .cm-panel button": { fontSize: "13px", backgroundImage: "none" },
    ".cm-foldPlaceholder": { backgroundColor: "var(--tint6)", border: "none", color: "var(--soft)" },
    ".cm-diagnostic": { whiteSpace: "pre-wrap" },
});
