"use strict";
// Shared cursor and zoom of all plots over time, the position of the player in them, and a close-up of 50 ms of
// the vibration. The page is complete without this script.
(() => {
  // A clipped side fades out, and a line explains how to see the rest.
  for (const box of document.querySelectorAll(".scroll, figure:not(.plot)")) {
    const hint = document.createElement("p");
    hint.className = "swipe";
    hint.textContent = matchMedia("(pointer: fine)").matches ? "scroll sideways" : "swipe sideways";
    box.before(hint);
    const fade = () => {
      const rest = box.scrollWidth - box.clientWidth;
      hint.hidden = rest < 2;
      box.classList.toggle("cut-left", rest >= 2 && box.scrollLeft > 1);
      box.classList.toggle("cut-right", rest >= 2 && rest - box.scrollLeft > 1);
    };
    box.addEventListener("scroll", fade, { passive: true });
    new ResizeObserver(fade).observe(box);
  }

  // On a phone a wide drawing is scaled to the page; a tap toggles its full size.
  for (const box of document.querySelectorAll("figure.wide")) {
    const narrow = matchMedia("(max-width: 600px)");
    const hint = document.createElement("p");
    hint.className = "swipe";
    const label = () => {
      hint.hidden = !narrow.matches;
      hint.textContent = box.classList.contains("open") ? "tap to fit" : "tap to enlarge";
    };
    box.after(hint);
    box.addEventListener("click", () => {
      if (!narrow.matches) return;
      box.classList.toggle("open");
      label();
    });
    narrow.addEventListener("change", label);
    label();
  }

  // Two vibrations in the channels of one player: the chosen one on both sides, without a gap. Until it plays, the browser
  // allows no sound to be routed.
  for (const pair of document.querySelectorAll(".beside")) {
    const audio = pair.querySelector("audio");
    const buttons = [...pair.querySelectorAll("button")];
    const gains = [];
    const choose = () =>
      gains.forEach((gain, k) => {
        const chosen = buttons[k].getAttribute("aria-pressed") === "true" ? 1 : 0;
        gain.gain.setTargetAtTime(chosen, gain.context.currentTime, 0.005);
      });
    if (!window.AudioContext) continue;
    pair.querySelector(".choice").hidden = false;
    audio.addEventListener("play", () => {
      if (gains.length > 0) return;
      const context = new AudioContext();
      const split = new ChannelSplitterNode(context, { numberOfOutputs: 2 });
      new MediaElementAudioSourceNode(context, { mediaElement: audio }).connect(split);
      buttons.forEach((_, k) => {
        gains.push(new GainNode(context, { gain: 0, channelCount: 1, channelCountMode: "explicit" }));
        split.connect(gains[k], k).connect(context.destination);
      });
      choose();
    });
    for (const button of buttons) {
      button.addEventListener("click", () => {
        buttons.forEach((other) => other.setAttribute("aria-pressed", String(other === button)));
        choose();
      });
    }
  }

  const SPAN = 1000; // width of the marks' coordinate system
  const SVG = "http://www.w3.org/2000/svg";
  const numbers = (text) => (text.match(/-?\d+(\.\d+)?/g) || []).map(Number);
  const plots = [...document.querySelectorAll("svg[data-time]")].map(plotOf);
  if (plots.length === 0) return;
  const whole = [Math.min(...plots.map((p) => p.time[0])), Math.max(...plots.map((p) => p.time[1]))];
  let view = whole;

  function plotOf(svg) {
    const [low, high] = numbers2(svg.dataset.time);
    const marks = svg.querySelector("svg.marks");
    const cursor = svg.appendChild(document.createElementNS(SVG, "line"));
    cursor.setAttribute("class", "cursor");
    cursor.setAttribute("y2", "100%");
    cursor.style.display = "none";
    const figure = svg.closest("figure");
    const outputs = [...figure.querySelectorAll("output")];
    const curves = [...marks.querySelectorAll("path.curve[d], path.band[d]")];
    const height = marks.viewBox.baseVal.height;
    const box = { svg, marks, cursor, outputs, curves, height, time: [low, high], y: numbers2(svg.dataset.y), points: new Map() };
    box.log = svg.dataset.spread === "log";
    box.fixed = figure.classList.contains("close-up");
    return box;
  }

  function numbers2(text) {
    return text.split(" ").map(Number);
  }

  // The points of a curve in the marks' coordinates, one list per part between gaps; for a band the upper and the
  // lower edge.
  function points(plot, path) {
    if (!plot.points.has(path)) {
      const pairsOf = (text) => {
        const all = numbers(text);
        const found = [];
        for (let i = 0; i + 1 < all.length; i += 2) found.push([all[i], all[i + 1]]);
        return found;
      };
      const drawn = path.getAttribute("d");
      const pairs = pairsOf(drawn);
      // The upper edge of a band runs to the right, the lower one back.
      const turn = pairs.findIndex((pair, i) => i > 0 && pair[0] <= pairs[i - 1][0]);
      const edges = path.classList.contains("band") && turn > 0 ? [pairs.slice(0, turn), pairs.slice(turn).reverse()] : drawn.split("M").map(pairsOf);
      plot.points.set(path, edges);
    }
    return plot.points.get(path);
  }

  // The value of a curve at x, interpolated between its points.
  function at(pairs, x) {
    let low = 0;
    let high = pairs.length - 1;
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (pairs[middle][0] > x) high = middle;
      else low = middle;
    }
    const [[x0, y0], [x1, y1]] = [pairs[low], pairs[high]];
    if (x <= x0 || x1 <= x0) return y0;
    return x >= x1 ? y1 : y0 + ((x - x0) / (x1 - x0)) * (y1 - y0);
  }

  function valueAt(plot, y) {
    const part = 1 - y / plot.height;
    const [low, high] = plot.y;
    if (plot.log) return low * (high / low) ** part;
    const value = low + part * (high - low);
    return Math.abs(value) < (high - low) / 5000 ? 0 : value; // below the resolution of the curve's coordinates
  }

  const shown = (value) => String(Number(value.toPrecision(3))).replace("-", "\u2212");

  function readings(plot, time) {
    const x = (SPAN * (time - plot.time[0])) / (plot.time[1] - plot.time[0]);
    plot.outputs.forEach((output, i) => {
      const path = plot.curves[i];
      const isThere = (edge) => edge.length > 0 && edge[0][0] <= x && x <= edge[edge.length - 1][0];
      const edges = path ? points(plot, path).filter(isThere) : [];
      const values = edges.map((edge) => shown(valueAt(plot, at(edge, x)))).reverse();
      output.textContent = values.length < 2 || values[0] === values[1] ? (values[0] ?? "") : values.join(" to ");
    });
  }

  // Moves the cursor of every plot to a time, or removes it.
  function point(time) {
    for (const plot of plots.filter((p) => !p.fixed)) {
      const part = (time - view[0]) / (view[1] - view[0]);
      const inside = time !== null && part >= 0 && part <= 1;
      plot.cursor.style.display = inside ? "" : "none";
      if (!inside) {
        plot.outputs.forEach((output) => (output.textContent = ""));
        continue;
      }
      plot.cursor.setAttribute("x1", `${100 * part}%`);
      plot.cursor.setAttribute("x2", `${100 * part}%`);
      readings(plot, time);
    }
    clock.textContent = time === null ? "" : `${time.toFixed(3)} s`;
  }

  function ticks([low, high], most) {
    const rough = (high - low) / most;
    const decade = 10 ** Math.floor(Math.log10(rough));
    const step = [1, 2, 5, 10].map((m) => m * decade).find((s) => s >= rough * 0.999);
    const digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
    const found = [];
    for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k += 1) {
      found.push([k * step, (k * step).toFixed(digits)]);
    }
    return found;
  }

  function element(name, attributes, text) {
    const made = document.createElementNS(SVG, name);
    for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
    if (text !== undefined) made.textContent = text;
    return made;
  }

  function drawTicks(plot, range) {
    const group = plot.svg.querySelector("g.ticks");
    const parts = ticks(range, 10).flatMap(([value, text], i) => {
      const at = `${(100 * (value - range[0])) / (range[1] - range[0])}%`;
      const odd = i % 2 === 1 ? " odd" : "";
      return [
        element("line", { class: "grid", x1: at, x2: at, y1: 0, y2: "100%" }),
        element("text", { class: `small soft${odd}`, x: at, y: "100%", dy: 15, "text-anchor": "middle" }, text),
      ];
    });
    group.replaceChildren(...parts);
  }

  // Shows an interval of time in every plot.
  function zoom([low, high]) {
    const least = (whole[1] - whole[0]) / 50;
    const middle = (low + high) / 2;
    const half = Math.max(high - low, least) / 2;
    view = [Math.max(whole[0], middle - half), Math.min(whole[1], middle + half)];
    for (const plot of plots.filter((p) => !p.fixed)) {
      const [from, to] = plot.time;
      const left = (SPAN * (view[0] - from)) / (to - from);
      const width = (SPAN * (view[1] - view[0])) / (to - from);
      plot.marks.setAttribute("viewBox", `${left} 0 ${width} ${plot.height}`);
      drawTicks(plot, view);
    }
    back.hidden = view[0] <= whole[0] && view[1] >= whole[1];
  }

  const tools = document.querySelector(".tools");
  const back = document.createElement("button");
  back.textContent = "Whole run";
  back.hidden = true;
  back.addEventListener("click", () => zoom(whole));
  const clock = document.createElement("output");
  if (document.querySelector(".close-up")) {
    tools.append(matchMedia("(pointer: fine)").matches ? " Click for 50 ms up close." : "Tap a plot for 50 ms up close.");
  }
  tools.append(back, clock);
  tools.hidden = false;

  function listen(plot) {
    let from = null;
    const chosen = plot.svg.appendChild(element("rect", { class: "chosen", height: "100%", width: 0 }));
    const partAt = (event) => {
      const box = plot.svg.getBoundingClientRect();
      return Math.min(1, Math.max(0, (event.clientX - box.left) / box.width));
    };
    const timeAt = (part) => view[0] + part * (view[1] - view[0]);
    plot.svg.addEventListener("pointermove", (event) => {
      const part = partAt(event);
      point(timeAt(part));
      if (from === null) return;
      chosen.setAttribute("x", `${100 * Math.min(from, part)}%`);
      chosen.setAttribute("width", `${100 * Math.abs(part - from)}%`);
    });
    plot.svg.addEventListener("pointerleave", () => point(null));
    plot.svg.addEventListener("pointerdown", (event) => {
      from = partAt(event);
      plot.svg.setPointerCapture(event.pointerId);
    });
    const end = (event) => {
      if (from === null) return;
      const to = partAt(event);
      const [a, b] = [timeAt(Math.min(from, to)), timeAt(Math.max(from, to))];
      if (event.type === "pointerup") {
        if (Math.abs(to - from) > 0.01) zoom([a, b]);
        else closeUp(a);
      }
      from = null;
      chosen.setAttribute("width", 0);
    };
    plot.svg.addEventListener("pointerup", end);
    plot.svg.addEventListener("pointercancel", end);
    plot.svg.addEventListener("dblclick", () => zoom(whole));
  }
  plots.filter((p) => !p.fixed).forEach(listen);

  const audio = document.querySelector("audio");
  if (audio) {
    const follow = () => {
      point(audio.currentTime);
      if (!audio.paused) requestAnimationFrame(follow);
    };
    audio.addEventListener("play", follow);
    audio.addEventListener("seeked", follow);
  }

  // The samples of the player: 16 bits each, after a header of 44 bytes.
  let samples = null;
  function played() {
    if (samples === null) {
      const bytes = atob(audio.src.slice(audio.src.indexOf(",") + 1));
      samples = new Int16Array((bytes.length - 44) >> 1);
      for (let i = 0; i < samples.length; i += 1) {
        samples[i] = bytes.charCodeAt(44 + 2 * i) | (bytes.charCodeAt(45 + 2 * i) << 8);
      }
    }
    return samples;
  }

  // Draws the close-up around a time.
  function closeUp(time) {
    const plot = plots.find((p) => p.fixed);
    if (!plot || !audio) return;
    const { rate, peak } = plot.svg.closest("figure").dataset;
    const all = played();
    const count = Math.round((plot.time[1] - plot.time[0]) * rate);
    const first = Math.max(0, Math.min(all.length - count, Math.round(time * rate - count / 2)));
    const [low, high] = plot.y;
    const d = [];
    for (let i = 0; i < Math.min(count, all.length); i += 1) {
      const value = (all[first + i] / 32767) * peak;
      const y = plot.height * (1 - (value - low) / (high - low));
      d.push(`${((SPAN * i) / count).toFixed(1)} ${y.toFixed(2)}`);
    }
    plot.curves[0].setAttribute("d", `M${d.join(" ")}`);
    drawTicks(plot, [first / rate, (first + count) / rate]);
  }
})();
