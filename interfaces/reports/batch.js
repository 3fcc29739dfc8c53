// Sorts the table of trials by the column whose heading is clicked; a second click reverses the order.

(function () {
  const headings = document.querySelectorAll("#trials th");
  const body = document.querySelector("#trials tbody");

  /** Compares two cell keys as numbers if both are numbers, else as text. */
  function compareKeys(a, b) {
    const [x, y] = [Number(a), Number(b)];
    return isNaN(x) || isNaN(y) ? a.localeCompare(b) : x - y;
  }

  function sortBy(column, ascending) {
    const keyOf = row => row.cells[column].dataset.key ?? row.cells[column].textContent;
    const rows = [...body.rows].sort((a, b) => (ascending ? 1 : -1) * compareKeys(keyOf(a), keyOf(b)));
    body.append(...rows);
  }

  headings.forEach((heading, column) => heading.addEventListener("click", () => {
    const ascending = heading.getAttribute("aria-sort") !== "ascending";
    headings.forEach(other => other.removeAttribute("aria-sort"));
    heading.setAttribute("aria-sort", ascending ? "ascending" : "descending");
    sortBy(column, ascending);
  }));
})();
