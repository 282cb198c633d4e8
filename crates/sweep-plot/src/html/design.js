// A design's page: points over every pair of parameters with their values under the pointer, the
// histogram, and a table of what the quantity depends on.

const MATRIX = { left: 84, right: 12, top: 8, bottom: 58, gap: 10 };
// Pixels within which the pointer finds a point.
const REACH = 12;

function createDesign(main, data) {
  const parts = {
    scatter: (host) => createMatrix(host, data.scatter),
    histogram: (host) => {
      const { title, subtitle, chart } = data.histogram;
      host.append(element("h2", {}, title), element("p", { class: "help" }, subtitle));
      createChart(host, decodedChart(chart), title);
    },
    influence: (host) => showInfluence(host, data.influence),
  };
  const names = [data.first, ...Object.keys(parts).filter((name) => name !== data.first)];
  for (const name of names) {
    const host = element("section", { id: name });
    main.append(host);
    parts[name](host);
  }
}

function createMatrix(host, data) {
  const decoded = (one) => ({ ...one, values: floats(one.values) });
  const [xs, quantity] = [data.parameters.map(decoded), decoded(data.quantity)];
  const ys = [...xs.slice(1), quantity];
  const count = xs.length;
  const directions = [...xs, quantity];
  let found = null;

  const figure = element("div", {
    class: "figure", tabindex: "0", role: "application",
    "aria-label": "Scatter matrix. Arrow keys go from point to point, Escape lets go.",
  });
  const tip = element("div", { class: "tip", hidden: true });
  const said = element("p", { class: "unseen", "aria-live": "polite" });
  const legend = element("ul", { class: "legend" });
  // As the points are drawn: a dot, a diamond, a ring, a cross.
  const signs = ["background:COLOUR;border-radius:50%", "background:COLOUR;transform:rotate(45deg)",
    "border:2px solid COLOUR;border-radius:50%", ""];
  data.sides.forEach((side, k) => {
    if (!side.count) return;
    const sign = element("i", {}, k === 3 ? "×" : "");
    const colour = lineColour(k === 3 ? "ink" : side.colour);
    sign.style.cssText = `width:10px;height:10px;line-height:10px;${signs[k]}`
      .replace("COLOUR", colour);
    legend.append(element("li", {}, sign, `${side.words} (${side.count})`));
  });
  if (data.level) {
    const sign = element("i");
    sign.style.cssText = "height:0;border-top:2px dotted currentColor";
    legend.append(element("li", {}, sign, data.level[1]));
  }
  host.append(figure, legend, said, element("p", { class: "help" }, "Hover or tap to read a point, "
    + "which is marked in every panel. Or focus the figure and use the arrow keys."
    + (data.note ? ` Shown: ${data.note}.` : "")));
  figure.append(tip);

  const side = () => (figure.clientWidth - MATRIX.left - MATRIX.right - MATRIX.gap * (count - 1))
    / count;
  const tall = () => Math.min(Math.max(0.8 * side(), 110), 380);
  const height = () => MATRIX.top + count * (tall() + MATRIX.gap) - MATRIX.gap + MATRIX.bottom;
  const part = (one, value) => {
    const even = one.log ? Math.log : (x) => x;
    const [from, to] = one.range.map(even);
    return (even(value) - from) / (to - from);
  };

  // Panels with their boxes: those below the diagonal, and the whole last row.
  function* panels() {
    for (let row = 0; row < count; row++) {
      for (let column = 0; column < (row === count - 1 ? count : row + 1); column++) {
        yield {
          row, column, x: xs[column], y: ys[row],
          left: MATRIX.left + column * (side() + MATRIX.gap),
          top: MATRIX.top + row * (tall() + MATRIX.gap),
        };
      }
    }
  }
  // Points without a value of y lie at the lower edge.
  const at = (panel, k) => {
    const y = part(panel.y, panel.y.values[k]);
    return [
      panel.left + part(panel.x, panel.x.values[k]) * side(),
      panel.top + (Number.isFinite(y) ? (1 - y) * tall() : tall() - 5),
    ];
  };

  function paint(context) {
    const [width, high] = [side(), tall()];
    const radius = Math.min(Math.max((0.25 * width) / Math.sqrt(data.of.length || 1), 1.2), 4);
    for (const panel of panels()) {
      frame(context, panel, width, high);
      context.save();
      context.beginPath();
      context.rect(panel.left, panel.top, width, high);
      context.clip();
      if (data.level && panel.y === quantity) {
        const y = panel.top + (1 - part(quantity, data.level[0])) * high;
        drawLine(context, panel.left, y, panel.left + width, y, [3, 3], themed("ink"));
      }
      context.globalAlpha = 0.8;
      data.sides.forEach((one, side) => {
        context.fillStyle = context.strokeStyle = lineColour(side === 3 ? "ink" : one.colour);
        context.beginPath();
        data.of.forEach((of, k) => {
          if (of === side) dot(context, side, ...at(panel, k), radius);
        });
        if (side < 2) context.fill();
        else context.stroke();
      });
      context.globalAlpha = 1;
      if (found !== null) {
        context.beginPath();
        context.strokeStyle = themed("accent");
        context.lineWidth = 2.5;
        context.arc(...at(panel, found), radius + 4, 0, 2 * Math.PI);
        context.stroke();
        context.lineWidth = 1;
      }
      context.restore();
    }
  }

  function dot(context, side, x, y, radius) {
    if (side === 1) {
      const reach = 1.25 * radius;
      context.moveTo(x + reach, y);
      for (const [dx, dy] of [[0, 1], [-1, 0], [0, -1]]) {
        context.lineTo(x + reach * dx, y + reach * dy);
      }
      context.closePath();
    } else if (side === 3) {
      const reach = Math.max(radius, 2.5);
      for (const slope of [1, -1]) {
        context.moveTo(x - reach, y - slope * reach);
        context.lineTo(x + reach, y + slope * reach);
      }
    } else {
      context.moveTo(x + radius, y);
      context.arc(x, y, radius, 0, 2 * Math.PI);
    }
  }

  function frame(context, panel, width, high) {
    const bottom = panel.top + high;
    context.lineWidth = 1;
    context.font = `12px ${FONT}`;
    context.fillStyle = themed("ink");
    for (const [value, label] of ticks(...panel.x.range, width / 80, panel.x.ticks)) {
      const x = panel.left + part(panel.x, value) * width;
      drawLine(context, x, panel.top, x, bottom, [], themed("faint"));
      context.textAlign = "center";
      if (panel.row === count - 1) context.fillText(label, x, bottom + 16);
    }
    for (const [value, label] of ticks(...panel.y.range, high / 40, panel.y.ticks)) {
      const y = panel.top + (1 - part(panel.y, value)) * high;
      drawLine(context, panel.left, y, panel.left + width, y, [], themed("faint"));
      context.textAlign = "right";
      if (panel.column === 0) context.fillText(label, panel.left - 6, y + 4);
    }
    context.strokeStyle = themed("ink");
    context.strokeRect(panel.left, panel.top, width, high);
    context.textAlign = "center";
    context.font = `13px ${FONT}`;
    if (panel.row === count - 1) {
      const lines = wrapped(context, withUnit(panel.x.words, panel.x.unit), width);
      const x = panel.left + width / 2;
      lines.forEach((line, k) => context.fillText(line, x, bottom + 34 + 15 * k, width));
    }
    if (panel.column === 0) {
      context.save();
      context.translate(0, panel.top + high / 2);
      context.rotate(-Math.PI / 2);
      const lines = wrapped(context, withUnit(panel.y.words, panel.y.unit), high);
      lines.forEach((line, k) => context.fillText(line, 0, 14 + 15 * k, high + 10));
      context.restore();
    }
  }

  const { request, canvas } = surface(figure, height, paint);

  function tell(place) {
    tip.hidden = found === null;
    if (found === null) {
      said.textContent = "";
      request();
      return;
    }
    const head = `Point ${data.points[found]}: ${data.sides[data.of[found]].words}`;
    const rows = directions.map((one) => [one.words, significant(one.values[found]), one.unit]);
    tip.replaceChildren(element("p", {}, head), element("table", {}, element("tbody", {},
      ...rows.map(([words, value, unit]) => element("tr", {},
        element("th", { scope: "row" }, words), element("td", {}, value),
        element("td", {}, unit))))));
    tip.dataset.point = data.points[found];
    said.textContent = [head, ...rows.map((row) => row.join(" ").trim())].join("; ");
    const [x, y] = place ?? at([...panels()].at(-1), found);
    const room = figure.clientWidth - tip.offsetWidth;
    const left = x + 16 > room ? x - 16 - tip.offsetWidth : x + 16;
    tip.style.left = `${Math.max(0, Math.min(left, room))}px`;
    tip.style.top = `${Math.max(0, Math.min(y + 12, height() - tip.offsetHeight))}px`;
    request();
  }

  function read(event) {
    const bounds = canvas.getBoundingClientRect();
    const [x, y] = [event.clientX - bounds.left, event.clientY - bounds.top];
    let nearestBy = REACH;
    found = null;
    for (const panel of panels()) {
      const [dx, dy] = [x - panel.left, y - panel.top];
      if (dx < 0 || dy < 0 || dx > side() || dy > tall()) continue;
      data.of.forEach((_, k) => {
        const [px, py] = at(panel, k);
        const away = Math.hypot(px - x, py - y);
        if (away < nearestBy) [nearestBy, found] = [away, k];
      });
    }
    tell([x, y]);
  }

  figure.addEventListener("pointermove", read);
  figure.addEventListener("pointerdown", read);
  // A finger that is lifted leaves what it has read.
  const letGo = () => {
    found = null;
    tell();
  };
  figure.addEventListener("pointerleave", (event) => {
    if (event.pointerType === "mouse") letGo();
  });
  figure.addEventListener("blur", letGo);
  figure.addEventListener("keydown", (event) => {
    const step = { ArrowLeft: -1, ArrowRight: 1, ArrowUp: -10, ArrowDown: 10 }[event.key];
    if (event.key === "Escape") letGo();
    else if (step && data.of.length) {
      const next = found === null ? 0 : found + step;
      found = Math.min(Math.max(next, 0), data.of.length - 1);
      tell();
    } else return;
    event.preventDefault();
  });
}

function showInfluence(host, data) {
  const rows = data.rows.map(([words, rank, any]) => {
    const bar = element("div", { class: "bar", "aria-hidden": "true" });
    const span = (from, to, name) => {
      const piece = element("i", { class: name });
      piece.style.left = `${50 + 50 * Math.min(from, to)}%`;
      piece.style.width = `${50 * Math.abs(to - from)}%`;
      bar.append(piece);
    };
    span(-data.chance, data.chance, "chance");
    if (rank !== null) span(0, rank, "rank");
    if (any !== null && any > Math.abs(rank)) span(0, rank < 0 ? -any : any, "any");
    return element("tr", {}, element("th", { scope: "row" }, words),
      element("td", {}, significant(rank, 2)), element("td", {}, significant(any, 2)),
      element("td", { class: "wide" }, bar));
  });
  const head = ["Parameter", "Rank correlation (Spearman)",
    "Rising and falling alike (root of the correlation ratio)", "from −1 to 1"];
  host.append(element("h2", {}, data.title), element("p", { class: "help" }, data.subtitle),
    element("table", { class: "influence" },
      element("thead", {}, element("tr", {},
        ...head.map((text) => element("th", { scope: "col" }, text)))),
      element("tbody", {}, ...rows)),
    element("p", { class: "help" }, "In the grey, up to a magnitude of "
      + `${significant(data.chance, 2)}, a rank correlation may be chance (95 %).`));
}
