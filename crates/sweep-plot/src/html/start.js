(() => {
  document.getElementById("title").textContent = DATA.title;
  document.getElementById("subtitle").textContent = DATA.subtitle;
  const main = document.getElementById("main");
  if (DATA.kind === "map") {
    const [mapHost, panelHost, reportHost] = [0, 1, 2].map(() => element("div"));
    main.append(mapHost, panelHost, reportHost);
    const panel = DATA.live ? createLive(panelHost, DATA) : null;
    createReport(reportHost, DATA, createMap(mapHost, DATA, panel), panel);
  }
  else if (DATA.kind === "design") createDesign(main, DATA);
  else createChart(main, decodedChart(DATA.chart), DATA.title);
  showProvenance(DATA.provenance);
})();
