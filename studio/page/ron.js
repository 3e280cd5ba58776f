// RON in the editor: its highlighting, and the context of a place.
import { StreamLanguage } from "./vendor/codemirror.js";

export const ron = StreamLanguage.define({
    name: "ron",
    startState: () => ({ comment: 0 }),
    token(stream, state) {
        if (state.comment > 0) return inComment(stream, state);
        if (stream.eatSpace()) return null;
        if (stream.match("//")) return (stream.skipToEnd(), "lineComment");
        if (stream.match("/*")) return ((state.comment = 1), inComment(stream, state));
        if (stream.match(/^"(?:[^"\\]|\\.)*"?/)) return stream.match(/^\s*:/, false) ? "labelName" : "string";
        if (stream.match(/^[+-]?(?:0x[\da-f]+|\d[\d_]*(?:\.\d*)?(?:e[+-]?\d+)?|\.\d+|inf|NaN)\b/i)) return "number";
        if (stream.match(/^(?:true|false|None|Some|Required)\b/)) return "atom";
        if (stream.match(/^[A-Z]\w*/)) return "typeName";
        if (stream.match(/^[a-z_]\w*/)) return stream.match(/^\s*:/, false) ? "propertyName" : "variableName";
        if (stream.eat(/[()[\]{}]/)) return "bracket";
        stream.next();
        return "punctuation";
    },
    languageData: {
        commentTokens: { line: "//", block: { open: "/*", close: "*/" } },
        closeBrackets: { brackets: ["(", "[", "{", '"'] },
    },
});

function inComment(stream, state) {
    while (!stream.eol() && state.comment > 0) {
        if (stream.match("*/")) state.comment--;
        else if (stream.match("/*")) state.comment++;
        else stream.next();
    }
    return "blockComment";
}

// The context of the place `at`: the open brackets with the names before them, the key whose value it is in, and
// the string it is in.
export function placeOf(text, at) {
    const open = [];
    let word = "",
        key = null,
        i = 0;
    const token = /\/\/[^\n]*|\/\*[\s\S]*?(?:\*\/|$)|"(?:[^"\\]|\\.)*(?:"|$)|[A-Za-z_]\w*|[()[\]{}:,]/g;
    for (let match; (match = token.exec(text)) && match.index < at; i = token.lastIndex) {
        const [found] = match;
        const inside = token.lastIndex > at || (token.lastIndex === at && !/["/]$/.test(found));
        if (found.startsWith("//") || found.startsWith("/*")) {
            if (token.lastIndex >= at && !(found.endsWith("*/") && token.lastIndex === at)) return { comment: true, open, key };
        } else if (found.startsWith('"')) {
            if (inside) return { open, key, string: match.index + 1, end: token.lastIndex };
            word = found.slice(1, -1);
        } else if (found === ":") [key, word] = [word, ""];
        else if (found === ",") [key, word] = [null, ""];
        else if ("([{".includes(found)) {
            open.push({ bracket: found, name: word, key, at: match.index });
            [key, word] = [null, ""];
        } else if (")]}".includes(found)) {
            key = open.pop()?.key ?? null;
            word = "";
        } else if (!inside) word = found;
    }
    return { open, key, string: null, end: i };
}
