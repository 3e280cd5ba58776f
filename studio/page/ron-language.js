// How RON is highlighted in the editor.
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
