"use strict";
// What the map and the charts share: decoding, numbers, ticks, canvases that follow size and theme.

function decode(text) {
  const raw = atob(text);
  const bytes = new Uint8Array(raw.length);
  for (let k = 0; k < raw.length; k++) bytes[k] = raw.charCodeAt(k);
  return bytes;
}

// What gzip has packed, as a promise of its bytes.
function unpacked(text) {
  const stream = new Blob([decode(text)]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Response(stream).arrayBuffer();
}

function floats(text) {
  const view = new DataView(decode(text).buffer);
  return Float32Array.from({ length: view.byteLength / 4 }, (_, k) => view.getFloat32(4 * k, true));
}

function doubles(text) {
  return new Float64Array(decode(text).buffer);
}

// Integers of 16 bits times their unit; the least integer means no value.
function quantised(text, unit) {
  const view = new DataView(decode(text).buffer);
  return Float32Array.from({ length: view.byteLength / 2 }, (_, k) => {
    const value = view.getInt16(2 * k, true);
    return value === -32768 ? NaN : value * unit;
  });
}

function significant(value, digits = 4) {
  if (value === undefined || value === null || Number.isNaN(value)) return "–";
  if (value === 0) return "0";
  const size = Math.abs(value);
  if (size >= 1e7 || size < 1e-4) return value.toExponential(digits - 1);
  return String(Number(value.toPrecision(digits)));
}

// The page's numbers. `ticks` says where ticks can be, as in the program's own figures.
const DATA = JSON.parse(document.getElementById("data").textContent);

// Ticks from low to high, about count of them, as [value, label]; `sets` are those of a logarithmic
// axis, ever denser.
function ticks(low, high, count, sets) {
  if (!(high > low)) return [];
  const within = ([value]) => value >= low * (1 - 1e-9) && value <= high * (1 + 1e-9);
  let best = [];
  for (const set of sets ?? []) {
    const found = set.filter(within);
    if (best.length >= 2 && found.length > Math.max(count, 2) + 1) break;
    best = found;
  }
  if (best.length >= 2) return best;
  const { steps, slack, least } = DATA.ticks;
  const wanted = (slack * (high - low)) / Math.max(count, 1);
  for (let at = steps.findIndex(([step]) => step >= wanted); at >= 0; at--) {
    const [step, decimals] = steps[at];
    const [first, last] = [Math.ceil(low / step - 1e-9), Math.floor(high / step + 1e-9)];
    if (last - first + 1 < least) continue;
    return Array.from({ length: last - first + 1 }, (_, k) => {
      const value = (first + k) * step || 0;
      const isLong = decimals === null && value !== 0;
      const powers = () => value.toExponential().replace("e+", "e");
      return [value, isLong ? powers() : value.toFixed(decimals ?? 0)];
    });
  }
  return [];
}

// Words with their unit, if they have one.
function withUnit(words, unit) {
  return unit ? `${words} (${unit})` : words;
}

function capitalised(text) {
  return text.charAt(0).toUpperCase() + text.slice(1);
}

function element(tag, attributes = {}, ...children) {
  const node = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) node.addEventListener(name.slice(2), value);
    else if (value === true) node.setAttribute(name, "");
    else if (value !== false && value !== null) node.setAttribute(name, value);
  }
  node.append(...children);
  return node;
}

// The head of a table, a column a text.
function tableHead(texts) {
  const cells = texts.map((text) => element("th", { scope: "col" }, text));
  return element("thead", {}, element("tr", {}, ...cells));
}

function themed(name) {
  return getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
}

const darkTheme = matchMedia("(prefers-color-scheme: dark)");

// The same hues, lighter, for lines on a dark ground.
const onDark = {
  "#0072b2": "#4fa9e2",
  "#d55e00": "#f5893d",
  "#009e73": "#2cc79a",
  "#cc79a7": "#e3a0c6",
};

function lineColour(colour) {
  if (colour === "ink") return themed("ink");
  return darkTheme.matches ? onDark[colour] || colour : colour;
}

const FONT = '"Noto Sans", "Segoe UI", "Helvetica Neue", Arial, sans-serif';

// A canvas as wide as its host and `height` px high; `draw(context, width, height)` whenever either
// changes.
function surface(host, height, draw) {
  const canvas = element("canvas", { "aria-hidden": "true" });
  host.append(canvas);
  let pending = 0;
  const paint = () => {
    pending = 0;
    const [width, tall, ratio] = [host.clientWidth, height(), window.devicePixelRatio || 1];
    if (width === 0) return;
    const size = [Math.round(width * ratio), Math.round(tall * ratio)];
    if (canvas.width !== size[0] || canvas.height !== size[1]) {
      [canvas.width, canvas.height] = size;
      canvas.style.height = `${tall}px`;
    }
    const context = canvas.getContext("2d");
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.clearRect(0, 0, width, tall);
    draw(context, width, tall);
  };
  // Many changes before the next frame are one drawing.
  const request = () => {
    if (!pending) pending = requestAnimationFrame(paint);
  };
  new ResizeObserver(request).observe(host);
  darkTheme.addEventListener("change", request);
  request();
  return { canvas, request };
}

// Cells or ranges with points on both sides of a limit.
const MIXED = DATA.both;
const SHADE = DATA.shade;

// Buttons for those who have no wheel; `zoom` takes the factor by which the view grows.
function zoomButtons(zoom, reset) {
  const button = (text, label, onclick) => element("button", {
    type: "button", "aria-label": label, title: label, onclick,
  }, text);
  const whole = element("button", { type: "button", onclick: reset }, "Reset zoom");
  return element("span", { class: "zoom" }, button("+", "Zoom in", () => zoom(0.7)),
    button("−", "Zoom out", () => zoom(1 / 0.7)), whole);
}

// The wheel alone scrolls the page. With Ctrl or Command it zooms, and so does a pinch on a
// trackpad, which browsers report as such a wheel.
function zoomByWheel(figure, zoom) {
  figure.addEventListener("wheel", (event) => {
    if (!event.ctrlKey && !event.metaKey) return;
    event.preventDefault();
    zoom(event, Math.exp(0.0015 * Math.min(Math.max(event.deltaY, -900), 900)));
  }, { passive: false });
}

// A view [low, high] zoomed by `factor` about `centre`, kept within [least, greatest].
function zoomed([low, high], factor, centre, [least, greatest]) {
  const span = Math.min((high - low) * factor, greatest - least);
  const start = centre - ((centre - low) / (high - low)) * span;
  return moved([start, start + span], 0, [least, greatest]);
}

function moved([low, high], by, [least, greatest]) {
  const shift = Math.min(Math.max(by, least - low), greatest - high);
  return [low + shift, high + shift];
}

// What was run, in words, and the modes of its machine.
function createAbout(data) {
  const about = element("dl", { class: "about" });
  for (const [title, text] of data.about) {
    about.append(element("dt", {}, title), element("dd", {}, text));
  }
  const parts = data.about.length ? [element("h2", {}, "What was run"), about] : [];
  if (!data.resonances?.length) return parts;
  const heads = ["Motion", "Resonance (rpm)", "Damping ratio"];
  return [...parts, element("h2", {}, "Resonances of the machine as given"),
    element("table", { class: "modes" },
      tableHead(heads),
      element("tbody", {}, ...data.resonances.map(([motion, speed, damping]) => element("tr", {},
        element("th", { scope: "row" }, motion), element("td", {}, speed),
        element("td", {}, damping)))))];
}

function showProvenance(entries) {
  const list = element("dl");
  for (const [key, value] of entries) {
    const body = typeof value === "object" && value !== null
      ? element("details", { open: JSON.stringify(value).length < 600 },
        element("summary", {}, "show"),
        element("pre", { tabindex: "0" }, JSON.stringify(value, null, 2)))
      : document.createTextNode(String(value));
    list.append(element("dt", {}, key), element("dd", {}, body));
  }
  const host = document.getElementById("provenance");
  const fold = element("details", {}, element("summary", {}, "digests, versions, the plan"), list);
  host.append(entries.length ? fold : "The file says nothing about its origin.");
}
