// The graphs that a site or a studio offers, and their addresses.

// `{ cards: [{ name, about, folder, picture }], docs }`.
export async function cards() {
    const response = await fetch(new URL("gallery.json", import.meta.url));
    return response.ok ? response.json() : { cards: [] };
}

// This page's address with another file and graph; a studio's token stays.
function addressOf(file, graph) {
    const address = new URL(file, import.meta.url);
    const token = new URLSearchParams(location.search).get("token");
    if (token) address.searchParams.set("token", token);
    if (graph) address.searchParams.set("graph", graph);
    return address.href;
}

export const studioOf = (graph) => addressOf("studio.html", graph);
export const galleryAddress = () => addressOf("./", null);
