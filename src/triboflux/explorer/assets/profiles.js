// The profiles of up to three models over time: panels, legend, player, and the same in numbers.

import {by, el, pretty, say, shown, table} from "./dom.js"
import {Panel, extent, range} from "./plot.js"

const EVERY = 70

export class Profiles {
  constructor(moved) {
    this.moved = moved
    this.panels = []
    this.models = []
    this.timer = null
    this.slider = by("time")
    this.slider.addEventListener("input", () => this.go(Number(this.slider.value)))
    by("play").addEventListener("click", () => this.timer === null ? this.play() : this.pause())
  }

  // Show a set of runs: `frame` with times and positions, `values` by model.
  take(frame, values, runs) {
    const last = this.frame ? this.index === this.frame.times.length - 1 : true
    this.frame = frame
    this.values = values
    this.runs = runs
    this.models = [...values.keys()]
    this.slider.max = frame.times.length - 1
    this.index = last ? frame.times.length - 1 : Math.min(this.index, frame.times.length - 1)
    this.slider.value = this.index
    this.layOut()
    this.go(this.index)
  }

  style(model) {
    return `m${this.models.indexOf(model)}`
  }

  // The rows of a variable that has one value for each time and place.
  row(array, index) {
    const points = array.shape[1]
    return new Float32Array(array.buffer, array.byteOffset + 4 * index * points, points)
  }

  layOut() {
    const {panels, x, units, axis} = this.frame
    const xLabel = units === "si" ? `${axis} in m` : `${axis}/L`
    this.panels = panels.map((about) => {
      const panel = new Panel(`${about.symbol}  ${about.title}`, `in ${pretty(about.unit)}`)
      const drawn = this.models.filter((model) => this.values.get(model)[about.name])
      const lines = drawn.map((model) => ({name: model, style: this.style(model)}))
      if (about.name === "charge") lines.unshift({name: "initial", style: "initial"})
      panel.axes(x, extent(drawn.map((model) => this.values.get(model)[about.name])), lines, xLabel)
      if (about.name === "charge") panel.draw("initial", this.row(this.values.get(drawn[0]).charge, 0))
      return {about, panel, drawn}
    })
    by("panels").replaceChildren(...this.panels.map(({panel}) => panel.node))
    by("legend").replaceChildren(
      ...this.models.map((model) => {
        const run = this.runs.get(model)
        const stopped = run?.stop_text ? `, stops at t* = ${run.stop_text}` : ""
        const status = run && run.status !== "ok" ? `, ${run.status}` : ""
        return el("li", {}, el("span", {class: `swatch ${this.style(model)}`}), `${model}${stopped}${status}`)
      }),
      el("li", {}, el("span", {class: "swatch initial"}), "initial charge"),
    )
  }

  time() {
    return this.frame.times[this.index]
  }

  timeText() {
    return `t = ${shown(this.time())}${this.frame.units === "si" ? " s" : ""}`
  }

  go(index) {
    if (!this.frame) return
    this.index = index
    this.slider.value = index
    this.slider.setAttribute("aria-valuetext", this.timeText())
    say(by("time-text"), this.timeText())
    for (const {about, panel, drawn} of this.panels) {
      const told = []
      for (const model of drawn) {
        const values = this.row(this.values.get(model)[about.name], index)
        panel.draw(model, values)
        const [low, high] = range(values)
        told.push(low <= high ? `${model} from ${shown(low)} to ${shown(high)}` : `${model} has none`)
      }
      panel.describe(`${about.title} ${about.symbol} along the box at ${this.timeText()}, in ${pretty(about.unit)}: ${told.join("; ")}.`)
    }
    this.tell()
    this.moved(this.timer === null)
  }

  tell() {
    const head = ["model", ...this.frame.panels.map((about) => `${about.symbol}, from … to …`)]
    const rows = this.models.map((model) => [model, ...this.frame.panels.map((about) => {
      const array = this.values.get(model)[about.name]
      if (!array) return "not modelled"
      const [low, high] = range(this.row(array, this.index))
      return low <= high ? `${shown(low)} … ${shown(high)}` : "–"
    })])
    by("profile-table").replaceChildren(table(head, rows, `Ranges at ${this.timeText()}`))
  }

  play() {
    if (!this.frame) return
    if (this.index >= this.frame.times.length - 1) this.go(0)
    by("play").textContent = "Pause"
    this.timer = setInterval(() => {
      if (this.index >= this.frame.times.length - 1) this.pause()
      else this.go(this.index + 1)
    }, EVERY)
  }

  pause() {
    clearInterval(this.timer)
    this.timer = null
    by("play").textContent = "Play"
    this.moved(true)
  }
}
