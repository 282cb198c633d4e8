(() => {
  document.getElementById("title").textContent = DATA.title;
  document.getElementById("subtitle").textContent = DATA.subtitle;
  const main = document.getElementById("main");
  const [figureHost, panelHost, reportHost] = [0, 1, 2].map(() => element("div"));
  main.append(figureHost, panelHost, reportHost);
  const panel = DATA.live ? createLive(panelHost, DATA) : null;
  if (DATA.kind === "map") {
    createReport(reportHost, DATA, createMap(figureHost, DATA, panel), panel);
  } else {
    if (DATA.kind === "design") createDesign(figureHost, DATA, panel);
    else createChart(figureHost, decodeChart(DATA.chart), DATA.title, (x) => panel?.pinned([x]));
    panel?.connect();
  }
})();
