// Documentation text as nodes: text between back-ticks as code, all other as text.
import { make } from "./dom.js";

export function prose(text) {
    return (text ?? "")
        .split("`")
        .map((part, i) => (i % 2 ? make("code", { class: "mono", text: part }) : part))
        .filter((part) => part !== "");
}
