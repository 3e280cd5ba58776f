// RON as text: the context of a place, and its tree.
const TOKEN = /\/\/[^\n]*|\/\*|r(#*)"[\s\S]*?(?:"\1|$)|"(?:[^"\\]|\\[\s\S])*(?:"|$)|[A-Za-z_]\w*|[+-]?(?:\d|\.\d)(?:[eE][+-]?|[\w.])*|[()[\]{}:,]/g;

// The tokens of a text that say where in it one is: [text, from, to].
function* tokensOf(text) {
    const token = new RegExp(TOKEN);
    for (let match; (match = token.exec(text)); ) {
        if (match[0] === "/*") token.lastIndex = endOfComment(text, match.index);
        yield [text.slice(match.index, token.lastIndex), match.index, token.lastIndex];
    }
}

// Comments in brackets stand in one another.
function endOfComment(text, from) {
    const mark = /\/\*|\*\//g;
    mark.lastIndex = from;
    for (let depth = 0, match; (match = mark.exec(text)); ) {
        depth += match[0] === "/*" ? 1 : -1;
        if (depth === 0) return mark.lastIndex;
    }
    return text.length;
}

const isComment = (token) => token.startsWith("//") || token.startsWith("/*");
const isString = (token) => /^r?#*"/.test(token);

// The text in a string as it is written.
export function unquoted(written) {
    if (!isString(written)) return written;
    const raw = written.match(/^r(#*)"([\s\S]*)"\1$/);
    if (raw) return raw[2];
    const inner = written.slice(1, -1);
    const escapes = { n: "\n", t: "\t", r: "\r", 0: "\0" };
    return inner.replace(/\\(?:u\{([\da-fA-F]{1,6})\}|x([\da-fA-F]{2})|(.))/g, (_, code, byte, one) =>
        code || byte ? String.fromCodePoint(Math.min(0x10ffff, parseInt(code ?? byte, 16))) : (escapes[one] ?? one),
    );
}

// The context of the place `at`: the open brackets with the names before them, the key whose value it is in, and
// the string it is in.
export function placeOf(text, at) {
    const open = [];
    let word = "",
        key = null,
        i = 0;
    for (const [found, from, end] of tokensOf(text)) {
        if (from >= at) break;
        const inside = end > at || (end === at && !/["/#]$/.test(found));
        if (isComment(found)) {
            if (end >= at && !(found.endsWith("*/") && end === at)) return { comment: true, open, key };
        } else if (isString(found)) {
            if (inside) return { open, key, string: from + found.indexOf('"') + 1, end };
            word = unquoted(found);
        } else if (found === ":") [key, word] = [word, ""];
        else if (found === ",") [key, word] = [null, ""];
        else if ("([{".includes(found)) {
            open.push({ bracket: found, name: word, key, at: from });
            [key, word] = [null, ""];
        } else if (")]}".includes(found)) {
            key = open.pop()?.key ?? null;
            word = "";
        } else if (!inside) word = found;
        i = end;
    }
    return { open, key, string: null, end: i };
}

// The values of a text with their places: the one that stands last at its top level, which is the graph; null if there is none.
// A value is { from, to, text } or, with a bracket, { from, to, name, bracket, open, close, items }; an item of it
// { from, key, value, comma }: `key` is null in a list, `comma` the place of the comma after it or null.
export function treeOf(text) {
    const root = { items: [], item: null };
    const open = [root];
    for (const [found, from, to] of tokensOf(text)) if (!isComment(found)) take(open, found, from, to);
    for (const value of open.slice(1)) value.close = value.to = text.length; // it is not closed
    return root.items.at(-1)?.value ?? null;
}

function take(open, found, from, to) {
    const within = open.at(-1);
    const { item } = within;
    if (found === ",") {
        if (item) [item.comma, within.item] = [from, null];
    } else if (found === ":") {
        if (item?.value) [item.key, item.value] = [unquoted(item.value.text ?? ""), null];
    } else if (")]}".includes(found)) {
        if (open.length === 1) return;
        Object.assign(within, { close: from, to, item: null });
        open.pop();
    } else {
        const isOpening = "([{".includes(found);
        if (isOpening && found === "(" && item?.value && /^[A-Za-z_]/.test(item.value.text ?? "") && !isString(item.value.text)) {
            // The name before the bracket.
            Object.assign(item.value, { name: item.value.text, text: null });
        } else {
            if (!item) within.items.push((within.item = { from, key: null, value: null, comma: null }));
            within.item.value = { from, to, name: "", text: isOpening ? null : found };
        }
        if (isOpening) open.push(Object.assign(within.item.value, { bracket: found, open: from, close: null, items: [], item: null }));
    }
}

// The places of the comments of a text: [[from, to]].
export const commentsOf = (text) => [...tokensOf(text)].filter(([found]) => isComment(found)).map(([, from, to]) => [from, to]);
