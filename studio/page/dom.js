// Making and finding elements. Text from the engine enters the page here only, as text.
export const find = (id) => document.getElementById(id);

// An element `tag`; `properties` are attributes, `on...` listeners, `text`; `children` are elements or strings.
export function make(tag, properties = {}, ...children) {
    const element = document.createElement(tag);
    for (const [name, value] of Object.entries(properties)) {
        if (value === null || value === undefined || value === false) continue;
        if (name === "text") element.textContent = value;
        else if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
        else if (name in element && typeof value !== "string") element[name] = value;
        else element.setAttribute(name, value);
    }
    element.append(...children.filter((child) => child !== null && child !== undefined && child !== false));
    return element;
}

// Sets text only if it changed, so that a screen reader does not repeat it.
export function setText(element, text) {
    if (element.textContent !== text) element.textContent = text;
}

// True if `element` takes text.
export function takesText(element) {
    return (
        element instanceof HTMLElement &&
        (element.isContentEditable ||
            element.tagName === "TEXTAREA" ||
            element.tagName === "SELECT" ||
            (element.tagName === "INPUT" && !["range", "checkbox", "file", "button"].includes(element.type)))
    );
}

// The page's storage in the browser; empty if the browser does not allow it.
export const kept = {
    get(key, otherwise) {
        try {
            return JSON.parse(localStorage.getItem(`studio.${key}`)) ?? otherwise;
        } catch {
            return otherwise;
        }
    },
    set(key, value) {
        try {
            localStorage.setItem(`studio.${key}`, JSON.stringify(value));
        } catch {
            // Private windows may have no storage; the page works without it.
        }
    },
};

// Lets the browser download a Blob.
export function save(name, blob) {
    const address = URL.createObjectURL(blob);
    make("a", { href: address, download: name }).click();
    setTimeout(() => URL.revokeObjectURL(address), 1000);
}

// An SVG text as the address of an image: in an image no script runs and nothing is loaded.
export const imageOf = (svg) => `data:image/svg+xml;charset=utf-8,${encodeURIComponent(svg)}`;
