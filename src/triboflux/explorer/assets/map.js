// The map: which model suits over two inputs, and the current case as a point that can be moved.

import {by, el, say, shown, svg} from "./dom.js"

const WIDTH = 520, HEIGHT = 360, LEFT = 64, RIGHT = 12, TOP = 10, BOTTOM = 44
const NUDGE = 0.02
const OTHERS = {none: ["–", "no model holds"], unknown: ["?", "not judged"], refused: ["×", "refused"]}

export class Map2D {
  constructor(setup, form, moved) {
    this.form = form
    this.moved = moved
    this.setup = setup
    this.models = Object.keys(setup.models)
    this.axes = null
    this.wanted = {...setup.usual_axes}
    this.node = svg("svg", {viewBox: `0 0 ${WIDTH} ${HEIGHT}`, class: "plot map", role: "group",
      "aria-labelledby": "map-title", "aria-describedby": "map-help map-words"})
    this.cells = svg("g", {role: "img"})
    this.frame = svg("g")
    this.dot = svg("circle", {r: 9, class: "dot", tabindex: 0, role: "slider", id: "point",
      "aria-roledescription": "point", "aria-valuemin": 0, "aria-valuemax": 100,
      "aria-describedby": "map-help", onkeydown: (event) => this.key(event)})
    this.node.append(this.cells, this.frame, this.dot)
    this.node.addEventListener("pointerdown", (event) => this.grab(event))
    this.node.addEventListener("pointermove", (event) => this.drag(event))
    this.node.addEventListener("pointerup", () => { this.held = false })
    this.node.addEventListener("pointercancel", () => { this.held = false })
    by("map-plot").replaceChildren(this.node)
    this.pickers()
  }

  pickers() {
    const kind = this.form.kind
    const picker = (number, label) => {
      const select = el("select", {id: `axis-${number}`, onchange: () => {
        const names = [...this.wanted[kind]]
        if (names[1 - number] === select.value) names[1 - number] = names[number]
        names[number] = select.value
        this.wanted[kind] = names
        this.pickers()
        this.moved(true)
      }}, ...this.setup.axes[kind].map((name) => el("option", {value: name,
        selected: name === this.wanted[kind][number]}, this.form.fields.get(name).label)))
      return [el("label", {for: `axis-${number}`}, label), select]
    }
    by("map-axes").replaceChildren(...picker(0, "Across"), ...picker(1, "Up"))
  }

  names() {
    return this.wanted[this.form.kind]
  }

  // Where a value stands between the ends of an axis, from 0 to 1.
  part(number, value) {
    return this.form.part(this.form.fields.get(this.axes[number].name), value)
  }

  toX(part) { return LEFT + part * (WIDTH - LEFT - RIGHT) }

  toY(part) { return HEIGHT - BOTTOM - part * (HEIGHT - TOP - BOTTOM) }

  style(name) {
    const index = this.models.indexOf(name)
    return index < 0 ? `cell-${name}` : `cell c${Math.min(index, 6)}`
  }

  letter(name) {
    if (OTHERS[name]) return OTHERS[name][0]
    const earlier = this.models.slice(0, this.models.indexOf(name))
    const clash = earlier.some((other) => other[0] === name[0])
    return (clash ? name.slice(0, 2) : name[0]).toUpperCase()
  }

  take({axes, cells, point}, newest) {
    const another = !this.axes || this.axes.some((axis, i) => axis.name !== axes[i].name)
    this.axes = axes
    if (another) this.layOut()
    const [across, up] = axes.map((axis) => axis.values.length)
    const edge = (i, count) => Math.min(Math.max((i - 0.5) / (count - 1), 0), 1)
    const counts = new Map()
    this.cells.replaceChildren(...cells.flatMap(([i, j, name, why, run]) => {
      counts.set(name, (counts.get(name) ?? 0) + 1)
      const x = this.toX(edge(i, across)), right = this.toX(edge(i + 1, across))
      const bottom = this.toY(edge(j, up)), y = this.toY(edge(j + 1, up))
      return [
        svg("rect", {x, y, width: right - x + 0.3, height: bottom - y + 0.3, class: this.style(name)},
          svg("title", {}, `${name}: ${why}`)),
        svg("text", {x: (x + right) / 2, y: (y + bottom) / 2 + 4, class: `letter ${this.style(name)}`,
          "text-anchor": "middle"}, this.letter(name)),
      ]
    }))
    const whole = across * up
    const told = [...counts].sort((a, b) => b[1] - a[1])
      .map(([name, count]) => `${OTHERS[name]?.[1] ?? name} ${Math.round((100 * count) / cells.length)} %`)
    const missing = cells.length < whole ? ` So far ${cells.length} of ${whole} points.` : ""
    const looked = cells.filter(([, , name, , run]) => !run && name !== "refused").length
    const source = looked === 0 ? "by running all models at each point"
      : `by the table of the package${looked < cells.length ? " and, where that has no answer, by running all models" : ""}`
    say(by("map-words"), cells.length ? `Of this plane, ${source}: ${told.join(", ")}.${missing}` : "")
    this.cells.setAttribute("aria-label", by("map-words").textContent)
    by("map-legend").replaceChildren(...[...counts.keys()].map((name) => el("li", {},
      el("span", {class: `chip ${this.style(name)}`}, this.letter(name)), OTHERS[name]?.[1] ?? name)))
    if (newest && !this.held) this.place(point)
  }

  layOut() {
    const marks = []
    this.axes.forEach(({name, values}, number) => {
      const field = this.form.fields.get(name)
      const low = values[0], high = values.at(-1)
      const places = []
      if (field.logarithmic) {
        const first = Math.ceil(Math.log10(low) - 1e-9), last = Math.floor(Math.log10(high) + 1e-9)
        const step = Math.ceil((last - first) / 6) || 1
        for (let power = first; power <= last; power += step) places.push(10 ** power)
      } else places.push(low, (low + high) / 2, high)
      for (const value of places) {
        const part = this.part(number, value)
        const text = shown(value, 2)
        marks.push(number === 0
          ? svg("text", {x: this.toX(part), y: HEIGHT - BOTTOM + 16, "text-anchor": part > 0.97 ? "end" : "middle"}, text)
          : svg("text", {x: LEFT - 6, y: this.toY(part) + (part > 0.97 ? 9 : 4), "text-anchor": "end"}, text))
      }
      const label = `${field.label}${field.unit ? ` in ${field.unit}` : ""}`
      marks.push(number === 0
        ? svg("text", {x: (LEFT + WIDTH - RIGHT) / 2, y: HEIGHT - 6, "text-anchor": "middle", class: "title"}, label)
        : svg("text", {transform: `translate(13 ${(HEIGHT - BOTTOM) / 2}) rotate(-90)`, "text-anchor": "middle", class: "title"}, label))
    })
    this.frame.replaceChildren(...marks,
      svg("rect", {x: LEFT, y: TOP, width: WIDTH - LEFT - RIGHT, height: HEIGHT - TOP - BOTTOM, class: "border"}))
  }

  place(point) {
    const known = point.every((value) => value !== null && value > 0)
    this.dot.style.display = known ? "" : "none"
    if (!known) return
    this.parts = point.map((value, number) => this.part(number, value))
    this.show()
  }

  show() {
    this.dot.setAttribute("cx", this.toX(this.parts[0]))
    this.dot.setAttribute("cy", this.toY(this.parts[1]))
    const told = this.axes.map(({name}) => {
      const field = this.form.fields.get(name)
      return `${field.label} ${this.form.inputs.get(name).value}`
    })
    this.dot.setAttribute("aria-label", "The current case in the map")
    this.dot.setAttribute("aria-valuetext", told.join(", "))
    this.dot.setAttribute("aria-valuenow", Math.round(100 * this.parts[0]))
  }

  move(parts) {
    this.parts = parts.map((part) => Math.min(Math.max(part, 0), 1))
    this.axes.forEach(({name}, number) => {
      this.form.set(name, this.form.value(this.form.fields.get(name), this.parts[number]))
    })
    this.show()
    this.moved(false)
  }

  at(event) {
    const box = this.node.getBoundingClientRect()
    const x = ((event.clientX - box.left) / box.width) * WIDTH
    const y = ((event.clientY - box.top) / box.height) * HEIGHT
    return [(x - LEFT) / (WIDTH - LEFT - RIGHT), (HEIGHT - BOTTOM - y) / (HEIGHT - TOP - BOTTOM)]
  }

  grab(event) {
    if (!this.axes || event.target !== this.dot) return
    this.held = true
    this.node.setPointerCapture(event.pointerId)
    this.dot.focus()
    event.preventDefault()
  }

  drag(event) {
    if (this.held) this.move(this.at(event))
  }

  key(event) {
    const steps = {ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1]}
    const step = steps[event.key]
    if (!step || !this.parts) return
    event.preventDefault()
    const by_ = event.shiftKey ? 5 * NUDGE : NUDGE
    this.move(this.parts.map((part, number) => part + by_ * step[number]))
  }
}
