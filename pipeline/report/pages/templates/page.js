"use strict";
// Read values off a chart: the drawn paths are the data, the svg says how pixels map to units.
for (const svg of document.querySelectorAll("svg.chart[data-x]")) {
  const axis = (name) => svg.dataset[name].split(" ").map(Number);
  const [x0, x1, px0, px1] = axis("x"),
    [y0, y1, py0, py1] = axis("y");
  const tidy = (number) => Number(number.toPrecision(4)).toString().replace("-", "\u2212");
  let curves = null,
    cursor = null,
    readout = null;
  const prepare = () => {
    const points = (d) => [...d.matchAll(/[ML]([-\d.]+) ([-\d.]+)/g)].map((m) => [+m[1], +m[2]]);
    curves = [...svg.querySelectorAll("path[data-label]:not(.residual):not(.bars):not(.caps)")].map(
      (path) => ({
        name: [path.dataset.label, ["fitted", "before"].find((css) => path.classList.contains(css)) || "measured"]
          .filter(Boolean)
          .join(" "),
        points: points(path.getAttribute("d")),
      }),
    );
    const add = (tag, css) =>
      svg
        .appendChild(Object.assign(document.createElementNS(svg.namespaceURI, tag), {}))
        .classList.add(css) || svg.lastChild;
    cursor = add("path", "cursor");
    readout = add("text", "readout");
    readout.setAttribute("x", px1);
    readout.setAttribute("y", 15);
  };
  svg.addEventListener("pointermove", (event) => {
    if (!curves) prepare();
    const at = new DOMPoint(event.clientX, event.clientY).matrixTransform(
      svg.getScreenCTM().inverse(),
    );
    let best = null;
    for (const curve of curves)
      for (const point of curve.points) {
        const away = Math.hypot(point[0] - at.x, (point[1] - at.y) * 0.25);
        if (!best || away < best.away) best = { away, point, curve };
      }
    if (!best) return;
    const [px, py] = best.point;
    const x = x0 + ((px - px0) * (x1 - x0)) / (px1 - px0),
      y = y0 + ((py - py0) * (y1 - y0)) / (py1 - py0);
    cursor.setAttribute("d", `M${px} ${py1}V${svg.dataset.bottom}`);
    readout.textContent = `${best.curve.name}: ${tidy(x)} ${svg.dataset.xUnit}, ${tidy(y)} ${svg.dataset.yUnit}`;
  });
  svg.addEventListener("pointerleave", () => {
    if (curves) {
      cursor.removeAttribute("d");
      readout.textContent = "";
    }
  });
}
// Find and sort motors in a long table.
for (const field of document.querySelectorAll("input.filter")) {
  const rows = [...document.getElementById(field.dataset.table).tBodies[0].rows];
  field.addEventListener("input", () => {
    const words = field.value.toLowerCase().split(/\s+/);
    for (const row of rows)
      row.hidden = !words.every((word) => row.textContent.toLowerCase().includes(word));
  });
}
for (const button of document.querySelectorAll("th button"))
  button.addEventListener("click", () => {
    const head = button.closest("th"),
      body = head.closest("table").tBodies[0],
      column = head.cellIndex;
    const down = head.getAttribute("aria-sort") === "ascending";
    for (const other of head.parentNode.cells) other.removeAttribute("aria-sort");
    head.setAttribute("aria-sort", down ? "descending" : "ascending");
    const key = (row) => row.cells[column].dataset.sort ?? row.cells[column].textContent;
    const compare = (a, b) =>
      (key(a) === "") - (key(b) === "") || key(a).localeCompare(key(b), "en", { numeric: true });
    const numeric = (a, b) =>
      (key(a) === "") - (key(b) === "") || (down ? key(b) - key(a) : key(a) - key(b));
    const rows = [...body.rows].sort(
      head.dataset.numeric ? numeric : (a, b) => (down ? compare(b, a) : compare(a, b)),
    );
    body.append(...rows);
  });
// Copy a command; without the clipboard (a page from a file) it is selected instead.
for (const button of document.querySelectorAll("button.copy"))
  button.addEventListener("click", async () => {
    const code = button.previousElementSibling;
    try {
      await navigator.clipboard.writeText(code.textContent);
      button.textContent = "Copied";
    } catch {
      const range = document.createRange();
      range.selectNodeContents(code);
      getSelection().removeAllRanges();
      getSelection().addRange(range);
    }
  });
// The same captures give the same page anywhere, so its commands do not know where they lie. The
// reader says it once; the page knows where itself lies.
{
  const codes = [...document.querySelectorAll(".command code")];
  const texts = codes.map((code) => code.textContent);
  const quoted = (path) => (/^[\w@%+=:,./-]+$/.test(path) ? path : `'${path.replaceAll("'", "'\\''")}'`);
  const output =
    location.protocol === "file:" ? decodeURIComponent(location.pathname.replace(/\/[^/]*\/[^/]*$/, "")) : "OUTPUT";
  const fill = (folder) =>
    codes.forEach((code, place) => {
      code.textContent = texts[place]
        .replace("input=FOLDER", `input=${quoted(folder || "FOLDER")}`)
        .replace(/(output|effects_path)=OUTPUT/g, (_, key) => `${key}=${quoted(output)}`);
    });
  const first = codes.find((_, place) => texts[place].includes("input=FOLDER"));
  const key = `captures of ${output}`;
  let folder = "";
  try {
    folder = localStorage.getItem(key) || "";
  } catch {} // a browser may keep nothing for a page from a file
  if (first) {
    const label = Object.assign(document.createElement("label"), { className: "folder", textContent: "Folder of the captures " });
    const field = Object.assign(document.createElement("input"), { value: folder, placeholder: "FOLDER" });
    field.addEventListener("input", () => {
      fill(field.value.trim());
      try {
        localStorage.setItem(key, field.value.trim());
      } catch {}
    });
    label.append(field);
    first.closest(".command").before(label);
  }
  fill(folder);
}
// A link to something folded opens it.
const unfold = () => {
  const place =
    location.hash.length > 1 && document.getElementById(decodeURIComponent(location.hash.slice(1)));
  for (let fold = place; fold; fold = fold.parentElement)
    if (fold.tagName === "DETAILS") fold.open = true;
  if (place) place.scrollIntoView();
};
addEventListener("hashchange", unfold);
unfold();
// On a narrow screen rows are stacked: each cell says which column it was.
for (const table of document.querySelectorAll("table.stack")) {
  const heads = [...(table.tHead?.rows[0].cells ?? [])].map((cell) => cell.textContent.trim());
  for (const body of table.tBodies)
    for (const row of body.rows) {
      let column = 0;
      for (const cell of row.cells) {
        if (cell.tagName === "TD" && cell.colSpan === 1 && heads[column])
          cell.dataset.label = heads[column];
        column += cell.colSpan;
      }
    }
}
// A plot can be as wide as the page.
for (const figure of document.querySelectorAll("figure"))
  if (figure.querySelector("svg.chart")) {
    const button = Object.assign(document.createElement("button"), {
      type: "button",
      className: "enlarge",
      textContent: "Enlarge",
    });
    button.addEventListener("click", () => {
      button.textContent = figure.classList.toggle("big") ? "Smaller" : "Enlarge";
      figure.scrollIntoView({ block: "nearest" });
    });
    figure.prepend(button);
  }
