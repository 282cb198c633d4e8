(() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  document.getElementById("title").textContent = data.title;
  document.getElementById("subtitle").textContent = data.subtitle;
  const main = document.getElementById("main");
  if (data.kind === "map") createMap(main, data);
  else createChart(main, decodedChart(data.chart), data.title);
  showProvenance(data.provenance);
})();
