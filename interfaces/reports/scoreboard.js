// Sorts a table by the column whose heading is clicked; a second click reverses the order. Cells without a number stay last.

/** Orders two rows by the cells of a column, as numbers if both are, else as text. */
function compareRows(column, sign) {
  return (one, other) => {
    const [a, b] = [one, other].map(row => row.cells[column]);
    const [x, y] = [a, b].map(cell => cell.dataset.key ?? cell.textContent.trim());
    if (x === "" || y === "") return (x === "") - (y === "");
    return sign * (isNaN(x) || isNaN(y) ? x.localeCompare(y) : x - y);
  };
}

document.querySelectorAll("table").forEach(table => {
  const headings = [...table.querySelectorAll("thead th")];
  const body = table.tBodies[0];
  headings.forEach((heading, column) => heading.querySelector("button").addEventListener("click", event => {
    const first = event.currentTarget.dataset.first ?? "ascending";
    const second = first === "ascending" ? "descending" : "ascending";
    const order = heading.getAttribute("aria-sort") === first ? second : first;
    headings.forEach(other => other.removeAttribute("aria-sort"));
    heading.setAttribute("aria-sort", order);
    body.append(...[...body.rows].sort(compareRows(column, order === "ascending" ? 1 : -1)));
  }));
});
