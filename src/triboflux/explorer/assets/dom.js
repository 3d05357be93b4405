// Elements, numbers and ticks. Texts only ever become text nodes or attributes, never markup.

const SVG = "http://www.w3.org/2000/svg"

function filled(node, attributes, children) {
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) node.addEventListener(name.slice(2), value)
    else if (value === true) node.setAttribute(name, "")
    else if (value !== false && value !== null && value !== undefined) node.setAttribute(name, value)
  }
  node.append(...children.filter((child) => child !== null))
  return node
}

export const by = (id) => document.getElementById(id)

export function el(tag, attributes = {}, ...children) {
  return filled(document.createElement(tag), attributes, children)
}

export function svg(tag, attributes = {}, ...children) {
  return filled(document.createElementNS(SVG, tag), attributes, children)
}

// Replace the text of an element only if it is another one, so that readers are not told twice.
export function say(node, text) {
  if (node.textContent !== text) node.textContent = text
}

export function shown(value, digits = 4) {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–"
  if (value === 0) return "0"
  const size = Math.abs(value)
  if (size >= 1e-3 && size < 1e5) return String(Number(value.toPrecision(digits)))
  const [mantissa, exponent] = value.toExponential(digits - 1).split("e")
  return `${Number(mantissa)}e${Number(exponent)}`
}

const RAISED = {"-": "⁻", 0: "⁰", 1: "¹", 2: "²", 3: "³", 4: "⁴"}

// Units and scales as people write them.
export function pretty(unit) {
  return unit.replace(/sqrt\(Theta\)/g, "√Θ").replace(/epsilon_0/g, "ε₀").replace(/Q0/g, "Q₀")
    .replace(/\^/g, "").replace(/(?<=[A-Za-z₀])-?[1-4](?![\d.])/g, (power) => [...power].map((c) => RAISED[c]).join(""))
}

// Round numbers inside an interval, about as many as wanted.
export function ticks(low, high, wanted = 4) {
  const span = high - low
  if (!(span > 0)) return [low]
  const raw = span / wanted
  const power = 10 ** Math.floor(Math.log10(raw))
  const step = power * [1, 2, 5, 10].find((factor) => factor * power >= raw)
  const found = []
  for (let n = Math.ceil(low / step - 1e-9); n * step <= high + 1e-9 * step; n++) found.push(n * step)
  return found
}

export function table(head, rows, caption) {
  const cells = (row) => row.map((cell, i) => el(i ? "td" : "th", i ? {} : {scope: "row"}, cell))
  return el(
    "div", {class: "scroll"},
    el("table", {},
      el("caption", {class: "aside"}, caption),
      el("thead", {}, el("tr", {}, ...head.map((cell) => el("th", {scope: "col"}, cell)))),
      el("tbody", {}, ...rows.map((row) => el("tr", {}, ...cells(row)))),
    ),
  )
}
