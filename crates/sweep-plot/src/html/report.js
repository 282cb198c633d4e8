// The report of a map's page: a table of all points, the worst first by the quantity shown, and
// downloads.

// Number of rows of the table that are added at a time.
const ROWS_PER_STEP = 20;

function createReport(host, data, map, panel) {
  const { columns, isFilled, word, wordsOf, verdict, valuesOf, shownValue } = map.cells;
  const filledCells = Array.from({ length: columns.point.values.length }, (_, cell) => cell)
    .filter(isFilled);

  const find = appendTemplate(host, "report");
  const message = find("#taken");
  for (const action of [link, picture, numbers]) {
    find(`#${action.name}`).addEventListener("click", action);
  }
  createTable();

  function createTable() {
    const headings = ["", ...data.axes.map((axis) => withUnit(axis.words, axis.unit)), "",
      "Largest ratio", "in", "Verdict"];
    const find = appendTemplate(document.getElementById("about"), "points");
    const [title, moreButton] = [find("h2:last-of-type"), find("#more")];
    moreButton.addEventListener("click", addRows);
    const pointTable = table(headings, [], { id: "points" });
    moreButton.before(pointTable);
    const tableBody = pointTable.tBodies[0];
    const shownHead = pointTable.rows[0].cells[data.axes.length + 1];
    // The layer of the quantity shown. Unless it is the largest ratio, the table has a column for
    // it.
    let layer = null;
    function sortPoints() {
      layer = map.layer() ?? data.layers[0];
      const { values } = columns[layer.column];
      const sign = layer.worse === "less" ? 1 : -1;
      // Points without a value come last.
      const sortKey = (cell) => (Number.isFinite(values[cell]) ? sign * values[cell] : Infinity);
      filledCells.sort((a, b) => sortKey(a) - sortKey(b) || a - b);
      const isOther = layer.column !== "ratio_max";
      shownHead.hidden = !isOther;
      shownHead.textContent = withUnit(layer.title, columns[layer.column].unit);
      title.textContent = `Points, the ${layer.worse ? "worst" : "greatest"} first`
        + (isOther ? `: ${layer.title}` : "");
      tableBody.replaceChildren();
      shownCount = 0;
      addRows();
    }
    let shownCount = 0;
    function addRows() {
      const newCells = filledCells.slice(shownCount, shownCount + ROWS_PER_STEP);
      tableBody.append(...newCells.map(createRow));
      shownCount = Math.min(shownCount + ROWS_PER_STEP, filledCells.length);
      moreButton.hidden = shownCount === filledCells.length;
      const hiddenCount = filledCells.length - shownCount;
      moreButton.textContent = `${Math.min(ROWS_PER_STEP, hiddenCount)} more of ${hiddenCount}`;
    }
    function createRow(cell) {
      const showButton = element("button", { type: "button", onclick: () => map.go(cell) }, "show");
      const largestChannel = word("ratio_max_channel", cell);
      const layerValue = layer.column === "ratio_max" ? [] : [shownValue(layer.column, cell)];
      const texts = [...valuesOf(cell).map((value) => formatSignificant(value)), ...layerValue,
        shownValue("ratio_max", cell), largestChannel ? wordsOf(largestChannel) : "",
        verdict(cell).replace("linear model ", "")];
      const contents = [showButton, ...texts];
      return element("tr", {}, ...contents.map((content) => element("td", {}, content)));
    }
    sortPoints();
    map.onChange(() => map.layer() !== layer && sortPoints());
  }

  function link() {
    const state = { ...map.state(), live: panel?.values() };
    history.replaceState(null, "", `#${encodeURIComponent(JSON.stringify(state))}`);
    const showMessage = (suffix) => () => {
      message.textContent = `The link is in the address bar${suffix}.`;
    };
    (navigator.clipboard?.writeText(location.href) ?? Promise.reject())
      .then(showMessage(" and copied"), showMessage(""));
  }

  function restoreView() {
    if (location.hash.length < 2) return;
    let state = null;
    try {
      state = JSON.parse(decodeURIComponent(location.hash.slice(1)));
    } catch {
      message.textContent = "The link holds no view of this page.";
    }
    if (!state || typeof state !== "object") return;
    map.restore(state);
    if (Array.isArray(state.live)) panel?.restore(state.live);
  }

  function saveFile(blob, name) {
    const url = URL.createObjectURL(blob);
    element("a", { href: url, download: name }).click();
    setTimeout(() => URL.revokeObjectURL(url), 10000);
    message.textContent = `Saved as ${name}.`;
  }

  function picture() {
    const [mapCanvas] = map.canvases;
    const headHeight = Math.round(40 * (mapCanvas.width / mapCanvas.clientWidth));
    const { width, height } = mapCanvas;
    const image = element("canvas", { width, height: height + headHeight });
    const context = image.getContext("2d");
    context.fillStyle = themeColour("paper");
    context.fillRect(0, 0, image.width, image.height);
    write(context, map.title(), headHeight / 3, 0.65 * headHeight,
      { align: "left", size: headHeight / 2, bold: "bold", room: image.width - headHeight });
    for (const canvas of map.canvases) context.drawImage(canvas, 0, headHeight);
    image.toBlob((blob) => saveFile(blob, "map.png"));
  }

  function numbers() {
    const chosenPlace = map.chosen();
    if (!chosenPlace) {
      message.textContent = "Choose a point of the map first: click it, or press Enter on it.";
      return;
    }
    const cell = map.index(...chosenPlace);
    const lines = valuesOf(cell).map((value, k) => [data.axes[k].name, value]);
    for (const [name, column] of Object.entries(columns)) {
      const value = column.values[cell];
      lines.push([name, Number.isFinite(value) ? Number(value.toPrecision(7)) : ""]);
    }
    for (const name of Object.keys(data.codes)) lines.push([name, word(name, cell) ?? ""]);
    const text = `name,value\n${lines.map((line) => line.join(",")).join("\n")}\n`;
    saveFile(new Blob([text], { type: "text/csv" }), `point-${shownValue("point", cell, 9)}.csv`);
  }

  restoreView();
}
