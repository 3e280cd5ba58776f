// The gallery: a card of each graph, which opens it in the studio.
import { cards as load, studioOf } from "./cards.js";
import { find, make, setText } from "./dom.js";

const FIRST = "texturepad";
const TOUR = "studio.html";
const GROUPS = [
    ["Graphs", ({ folder }) => folder !== "cookbook"],
    ["Recipes", ({ folder }) => folder === "cookbook"],
];

// A picture is loaded shortly before it is seen: browsers' own lazy loading takes most of them at once.
const coming = new IntersectionObserver(
    (seen) => {
        for (const { target } of seen.filter(({ isIntersecting }) => isIntersecting)) {
            target.src = target.dataset.src;
            coming.unobserve(target);
        }
    },
    { rootMargin: "100px" },
);

// The picture's own text says what it shows; its alternative says where it comes from.
function pictureOf({ name, picture }) {
    const size = { width: "420", height: "190" };
    const image = make("img", { ...size, "data-src": picture, alt: `Two simulated seconds of ${name}`, decoding: "async" });
    coming.observe(image);
    return image;
}

// What in the text is between backquotes is code.
const textOf = (about) => about.split("`").map((part, i) => (i % 2 ? make("code", { text: part }) : part));

function cardOf(card) {
    const title = make("a", { href: studioOf(card.name), text: card.name });
    return make(
        "li",
        { class: "card", "data-name": card.name },
        pictureOf(card),
        make("h3", {}, title),
        make("p", {}, ...textOf(card.about)),
    );
}

function groupOf([title, holds], all) {
    const cards = all.filter(holds).map(cardOf);
    return cards.length ? [make("section", { "aria-label": title }, make("h2", { text: title }), make("ul", { class: "cards" }, ...cards))] : [];
}

// Shows the cards whose text has all words.
function filter(all) {
    const words = find("find").value.toLowerCase().split(/\s+/).filter(Boolean);
    const fits = ({ name, about }) => words.every((word) => `${name} ${about}`.toLowerCase().includes(word));
    const found = new Set(all.filter(fits).map(({ name }) => name));
    for (const card of document.querySelectorAll(".card")) card.hidden = !found.has(card.dataset.name);
    for (const group of document.querySelectorAll("#cards section")) group.hidden = !group.querySelector(".card:not([hidden])");
    setText(find("found"), words.length ? `${found.size} of ${all.length}` : "");
}

function linkDocs(pages) {
    const link = (page, text) => (pages.includes(page.split("#")[0]) ? [make("a", { href: `docs/${page}`, text })] : []);
    find("links").append(...link(`${TOUR}#a-first-tour`, "Tour"), ...link("cookbook.html", "Cookbook"), ...link("index.html", "Documentation"));
}

const { cards, docs = [] } = await load();
const asked = new URLSearchParams(location.search).get("graph");
// The address of a graph was once here; a single graph needs no gallery.
if (asked || cards.length === 1) location.replace(studioOf(asked ?? cards[0].name));
else if (cards.length) {
    const first = cards.find(({ name }) => name === FIRST) ?? cards[0];
    find("stroke").href = studioOf(first.name);
    find("hero").append(pictureOf(first), make("figcaption", { class: "soft", text: `What ${first.name} does to a simulated hand` }));
    linkDocs(docs);
    find("cards").append(...GROUPS.flatMap((group) => groupOf(group, cards)));
    find("find").addEventListener("input", () => filter(cards));
}
