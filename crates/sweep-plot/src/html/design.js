// The page of a design: points over every pair of parameters with their values under the pointer,
// the histogram, and the influence of each parameter.

// Distance within which the pointer finds a point, px.
const MAX_POINTER_DISTANCE = 12;

// Creates the page. `panel` is the live panel, which computes the chosen point.
function createDesign(main, data, panel) {
  const parts = {
    scatter: (host) => createMatrix(host, data.scatter, panel?.chosen),
    histogram: (host) => {
      const { title, subtitle, chart } = data.histogram;
      host.append(element("h2", {}, title), element("p", { class: "help" }, subtitle));
      createChart(host, decodeChart(chart), title);
    },
    influence: (host) => {
      host.append(element("div", { class: "figure drawn" }));
      host.firstChild.innerHTML = data.influence;
    },
  };
  const names = [data.first, ...Object.keys(parts).filter((name) => name !== data.first)];
  for (const name of names) {
    const host = element("section", { id: name });
    main.append(host);
    parts[name](host);
  }
}

// Shows the picture that the program has drawn, finds points in it under the pointer, and marks
// them.
function createMatrix(host, data, choosePoint = () => {}) {
  const directions = data.directions.map((direction) => (
    { ...direction, values: decodeFloats(direction.values) }));
  let selected = null;

  const find = appendTemplate(host, "design");
  const [figure, tip, announcement] = [".figure", ".tip", ".unseen"].map(find);
  if (data.note) find(".help").append(` Shown: ${data.note}.`);
  figure.insertAdjacentHTML("afterbegin", data.picture);
  const picture = figure.firstElementChild;
  picture.setAttribute("viewBox", data.view.join(" "));
  for (const size of ["width", "height"]) picture.removeAttribute(size);
  const marks = document.createElementNS(picture.namespaceURI, "g");
  picture.append(marks);

  const axisFraction = (direction, value) => {
    const coordinate = direction.log ? Math.log : (x) => x;
    const [low, high] = direction.range.map(coordinate);
    return (coordinate(value) - low) / (high - low);
  };
  // The panels: the directions along x and y, and the rectangle in the picture, as
  // [x, y, [left, top, width, height]].
  const panels = data.panels.map(([x, y, ...box]) => [directions[x], directions[y], box]);
  // Points without a value of y lie at the lower edge.
  const pointPosition = ([x, y, [left, top, width, height]], k) => {
    const yFraction = axisFraction(y, y.values[k]);
    return [
      left + axisFraction(x, x.values[k]) * width,
      top + (Number.isFinite(yFraction) ? (1 - yFraction) * height : height - 5),
    ];
  };
  // Returns the length of a pixel of the page in units of the picture.
  const scale = () => data.view[2] / picture.clientWidth;

  function showPoint(pointerPosition) {
    tip.hidden = selected === null;
    marks.innerHTML = selected === null ? "" : panels.map((panel) => pointPosition(panel, selected))
      .map(([x, y]) => `<circle cx="${x}" cy="${y}" r="7"/>`).join("");
    if (selected === null) {
      announcement.textContent = "";
      return;
    }
    const heading = `Point ${data.points[selected]}: ${data.sides[data.of[selected]]}`;
    const rows = directions.map(({ words, values, unit }) => [
      words, formatSignificant(values[selected]), unit,
    ]);
    tip.replaceChildren(element("p", {}, heading),
      table([], rows.map(([words, ...cells]) => tableRow(words, cells))));
    tip.dataset.point = data.points[selected];
    announcement.textContent = [heading, ...rows.map((row) => row.join(" ").trim())].join("; ");
    const [x, y] = (pointerPosition ?? pointPosition(panels.at(-1), selected))
      .map((value, k) => (value - data.view[k]) / scale());
    placeTip(tip, [x - 16, x + 16], y + 12, [0, picture.clientHeight]);
  }

  function selectNearest(event) {
    const bounds = picture.getBoundingClientRect();
    const x = data.view[0] + (event.clientX - bounds.left) * scale();
    const y = data.view[1] + (event.clientY - bounds.top) * scale();
    let nearestDistance = MAX_POINTER_DISTANCE * scale();
    selected = null;
    for (const panel of panels) {
      const [left, top, width, height] = panel[2];
      if (x < left || y < top || x > left + width || y > top + height) continue;
      data.of.forEach((_, k) => {
        const [pointX, pointY] = pointPosition(panel, k);
        const distance = Math.hypot(pointX - x, pointY - y);
        if (distance < nearestDistance) [nearestDistance, selected] = [distance, k];
      });
    }
    showPoint([x, y]);
  }

  figure.addEventListener("pointermove", selectNearest);
  figure.addEventListener("pointerdown", (event) => {
    selectNearest(event);
    chooseSelected();
  });
  function chooseSelected() {
    if (selected === null) return;
    choosePoint(Object.fromEntries(
      directions.map(({ name, values }) => [name, values[selected]])));
  }
  // After a touch the values stay visible, because a finger cannot hover.
  const deselect = () => {
    selected = null;
    showPoint();
  };
  figure.addEventListener("pointerleave", ({ pointerType }) => {
    if (pointerType === "mouse") deselect();
  });
  figure.addEventListener("blur", deselect);
  figure.addEventListener("keydown", (event) => {
    const step = { ArrowLeft: -1, ArrowRight: 1, ArrowUp: -10, ArrowDown: 10 }[event.key];
    if (event.key === "Escape") deselect();
    else if (event.key === "Enter") chooseSelected();
    else if (step && data.of.length) {
      const nextIndex = selected === null ? 0 : selected + step;
      selected = Math.min(Math.max(nextIndex, 0), data.of.length - 1);
      showPoint();
    } else return;
    event.preventDefault();
  });
}
