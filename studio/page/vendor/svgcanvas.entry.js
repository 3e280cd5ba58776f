// What figures use of svgcanvas; `build` bundles it into svgcanvas.js.
export { Context } from "svgcanvas";
