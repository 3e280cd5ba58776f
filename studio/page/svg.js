// SVG text as elements that only draw.
const DRAWS = new Set([
    "svg",
    "g",
    "path",
    "rect",
    "circle",
    "ellipse",
    "line",
    "polyline",
    "polygon",
    "text",
    "tspan",
    "title",
    "desc",
    "style",
    "defs",
    "marker",
    "clippath",
    "lineargradient",
    "radialgradient",
    "stop",
    "use",
    "pattern",
    "mask",
]);

// The drawing without whatever could run or load something; null if the text is not SVG.
export function cleaned(text) {
    const root = new DOMParser().parseFromString(text, "image/svg+xml").documentElement;
    if (root.nodeName !== "svg" || root.querySelector("parsererror")) return null;
    for (const element of [root, ...root.querySelectorAll("*")]) {
        if (!DRAWS.has(element.localName.toLowerCase())) {
            element.remove();
            continue;
        }
        for (const { name, value } of [...element.attributes])
            if (!harmless(name.toLowerCase(), value)) element.removeAttribute(name);
        if (element.localName === "style" && /@import|url\s*\(|expression/i.test(element.textContent)) element.remove();
    }
    return document.importNode(root, true);
}

function harmless(name, value) {
    if (name.startsWith("on")) return false;
    if (name === "href" || name.endsWith(":href")) return value.startsWith("#");
    return !/javascript:|url\s*\(\s*['"]?(?!#)/i.test(value);
}
