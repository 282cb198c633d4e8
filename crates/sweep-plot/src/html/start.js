(() => {
  document.getElementById("title").textContent = DATA.title;
  document.getElementById("subtitle").textContent = DATA.subtitle;
  const main = document.getElementById("main");
  if (DATA.kind === "map") createMap(main, DATA);
  else if (DATA.kind === "design") createDesign(main, DATA);
  else createChart(main, decodedChart(DATA.chart), DATA.title);
  showProvenance(DATA.provenance);
})();
