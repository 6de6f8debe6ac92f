// Tables of class "sortable": a click on a head sorts by its column, a second one the other way; words typed above leave the
// rows that have all of them. Without this script the tables stand as they are.
"use strict";
for (const table of document.querySelectorAll("table.sortable")) {
  const body = table.tBodies[0];
  const given = [...body.rows];
  const known = new Map(given.map((row, place) => [row, { place, text: row.textContent.toLowerCase() }]));

  const shown = document.createElement("span");
  shown.className = "soft";
  const words = document.createElement("input");
  words.type = "search";
  words.placeholder = "Show rows with…";
  words.setAttribute("aria-label", "Show only rows that have these words");
  words.addEventListener("input", () => {
    const wanted = words.value.toLowerCase().split(/\s+/).filter(Boolean);
    let count = 0;
    for (const row of given) {
      row.hidden = !wanted.every((word) => known.get(row).text.includes(word));
      count += row.hidden ? 0 : 1;
    }
    shown.textContent = wanted.length ? `${count} of ${given.length}` : "";
  });
  const line = document.createElement("p");
  line.className = "filter";
  line.append(words, " ", shown);
  (table.closest(".scroll") ?? table).before(line);

  // Numbers first, then words, then what is empty; rows that are alike stay in the order given.
  const key = (row, column) => {
    const text = row.cells[column]?.textContent.trim() ?? "";
    const isNumber = /^[−-]?\d+(\.\d+)?( ?(°|σ|× scatter))?$/.test(text);
    const number = isNumber ? parseFloat(text.replace("−", "-")) : 0;
    return { kind: text === "" || text === "—" ? 2 : isNumber ? 0 : 1, number, text };
  };
  const compare = (a, b, sign) =>
    a.kind - b.kind || sign * (a.kind === 0 ? a.number - b.number : a.text.localeCompare(b.text, undefined, { numeric: true }));
  [...table.tHead.rows[0].cells].forEach((head, column) => {
    const button = document.createElement("button");
    button.type = "button";
    button.append(...head.childNodes);
    head.append(button);
    button.addEventListener("click", () => {
      const sign = head.getAttribute("aria-sort") === "ascending" ? -1 : 1;
      for (const other of table.tHead.rows[0].cells) other.removeAttribute("aria-sort");
      head.setAttribute("aria-sort", sign > 0 ? "ascending" : "descending");
      const keyed = given.map((row) => [row, key(row, column)]);
      keyed.sort(([a, x], [b, y]) => compare(x, y, sign) || known.get(a).place - known.get(b).place);
      body.append(...keyed.map(([row]) => row));
    });
  });
}
