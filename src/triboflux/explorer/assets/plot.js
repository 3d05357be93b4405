// A panel of lines over the box, whose frames change without its axes.

import {shown, svg, ticks} from "./dom.js"

const WIDTH = 430, HEIGHT = 218
const LEFT = 58, RIGHT = 16, TOP = 26, BOTTOM = 34

export function range(values) {
  let low = Infinity, high = -Infinity
  for (const value of values) {
    if (value < low) low = value
    if (value > high) high = value
  }
  return [low, high]
}

export function extent(arrays) {
  const ends = arrays.map(range)
  const low = Math.min(...ends.map(([least]) => least)), high = Math.max(...ends.map(([, most]) => most))
  if (!(low <= high)) return [-1, 1]
  const room = 0.06 * (high - low) || Math.max(Math.abs(high), 1e-30) * 0.1
  return [low - room, high + room]
}

export class Panel {
  constructor(title, unit) {
    this.node = svg("svg", {viewBox: `0 0 ${WIDTH} ${HEIGHT}`, role: "img", class: "plot"})
    this.title = title
    this.unit = unit
  }

  // Lay out the axes: positions along the box, and the range of all that will be drawn.
  axes(x, [low, high], lines, xLabel) {
    const first = x[0], step = x[1] - x[0]
    const last = first + step * x.length
    this.end = WIDTH - RIGHT
    this.toY = (value) => HEIGHT - BOTTOM - ((value - low) / (high - low)) * (HEIGHT - TOP - BOTTOM)
    const toX = (value) => LEFT + ((value - first) / (last - first)) * (WIDTH - LEFT - RIGHT)
    this.x = Array.from(x, toX)
    const bottom = HEIGHT - BOTTOM
    const marks = []
    for (const tick of ticks(low, high)) {
      const y = this.toY(tick)
      marks.push(svg("line", {x1: LEFT, x2: this.end, y1: y, y2: y, class: Math.abs(tick) < 1e-12 * (high - low) ? "zero" : "grid"}))
      marks.push(svg("text", {x: LEFT - 6, y: y + 4, "text-anchor": "end"}, shown(Math.abs(tick) < 1e-12 * (high - low) ? 0 : tick, 3)))
    }
    for (const tick of ticks(first, last, 4)) {
      marks.push(svg("line", {x1: toX(tick), x2: toX(tick), y1: bottom, y2: bottom + 4, class: "axis"}))
      marks.push(svg("text", {x: toX(tick), y: bottom + 16, "text-anchor": "middle"}, shown(tick, 3)))
    }
    this.paths = new Map(lines.map(({name, style}) => [name, svg("path", {class: `line ${style}`})]))
    this.node.replaceChildren(
      svg("text", {x: LEFT, y: 16, class: "title"}, this.title,
        svg("tspan", {class: "unit", dx: 8}, this.unit)),
      ...marks,
      svg("line", {x1: LEFT, x2: this.end, y1: bottom, y2: bottom, class: "axis"}),
      svg("text", {x: this.end, y: HEIGHT - 3, "text-anchor": "end", class: "unit"}, xLabel),
      ...this.paths.values(),
    )
  }

  draw(name, values) {
    const path = this.paths.get(name)
    if (!path) return
    let d = "", pen = "M"
    for (let i = 0; i <= values.length; i++) {
      // the box is periodic, so its end is its beginning
      const value = values[i % values.length]
      if (!Number.isFinite(value)) {
        pen = "M"
        continue
      }
      d += `${pen}${(i < values.length ? this.x[i] : this.end).toFixed(1)} ${this.toY(value).toFixed(2)}`
      pen = "L"
    }
    path.setAttribute("d", d)
  }

  describe(text) {
    this.node.setAttribute("aria-label", text)
  }
}
