// The terms of each equation at the shown time, as lines and as a table.

import {by, el, shown, table} from "./dom.js"
import {Panel, extent} from "./plot.js"

const TITLES = {charge: "∂Q/∂t", covariance: "∂C/∂t", variance: "∂V/∂t"}

export function drawBudget(found, x, timeText, xLabel) {
  by("budget-when").textContent = `at ${timeText}`
  by("budget-plots").replaceChildren(...found.equations.map(({moment, terms}) => {
    const panel = new Panel(`${TITLES[moment] ?? moment}  ${moment}`, "scaled")
    const lines = terms.map((term, i) => ({name: term.name, style: `t${i % 8}`}))
    panel.axes(x, extent(terms.map((term) => term.values)), lines, xLabel)
    for (const term of terms) panel.draw(term.name, term.values)
    const told = terms.map((term) => `${term.name} up to ${shown(term.largest)}`).join("; ")
    panel.describe(`Terms of the equation of the ${moment}: ${told}.`)
    const rows = terms.map((term, i) => [
      el("span", {class: "term"}, el("span", {class: `swatch t${i % 8}`}), term.name),
      term.equation, shown(term.largest)])
    return el("div", {class: "equation"}, panel.node,
      table(["term", "equation", "largest"], rows, `Terms of the equation of the ${moment}`))
  }))
}
