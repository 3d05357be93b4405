// The page: it asks the session for what the inputs say, and draws what comes back.

import {by, el, say, table} from "./dom.js"
import {Form} from "./form.js"
import {Map2D} from "./map.js"
import {Profiles} from "./profiles.js"
import {drawBudget} from "./budget.js"

const PATIENCE = 300, LONG = 1500, PAUSE = 40

class Page {
  constructor(model) {
    this.model = model
    this.asked = 0
    this.answered = 0
    this.began = 0
    this.waiting = false
    this.profiles = new Profiles((resting) => this.wantBudget(resting))
    model.on("msg:custom", (message) => this[`on_${message.kind}`]?.(message))
    by("cancel").addEventListener("click", () => this.send("cancel"))
    by("budget-model").addEventListener("change", () => this.wantBudget(true))
    for (const button of by("downloads").querySelectorAll("button[data-what]")) {
      button.addEventListener("click", () => this.send("download", {
        what: button.dataset.what, model: by("download-model").value, frame: this.profiles.index}))
    }
    this.send("hello")
  }

  send(kind, content = {}) {
    this.model.send_msg({kind, ...content})
  }

  on_setup(setup) {
    this.form = new Form(setup, (now) => this.changed(now), (preset) => this.send("preset", {preset}))
    this.map = new Map2D(setup, this.form, (now) => this.changed(now))
    this.changed(true)
  }

  on_texts({fields}) {
    this.form.fill(fields)
    this.changed(true)
  }

  // Ask anew, but not before the last answer, lest a slider that moves never gets one.
  changed(now) {
    if (this.form.kind !== this.kind) {
      this.kind = this.form.kind
      this.map?.pickers()
    }
    this.waiting = true
    clearTimeout(this.timer)
    this.timer = setTimeout(() => this.ask(), now ? 0 : PAUSE)
  }

  ask() {
    const busy = this.answered < this.asked
    if (!this.waiting || (busy && performance.now() - this.began < LONG)) {
      if (this.waiting) this.timer = setTimeout(() => this.ask(), PAUSE)
      return
    }
    this.waiting = false
    this.asked += 1
    this.began = performance.now()
    this.values = new Map()
    this.runs = new Map()
    this.frame = null
    by("failure").hidden = true
    document.body.dataset.state = "busy"
    this.send("inputs", {asked: this.asked, values: {...this.form.values(), axes: this.map.names()}})
    clearTimeout(this.patience)
    this.patience = setTimeout(() => this.busy("Computing …", null), PATIENCE)
  }

  busy(text, fraction) {
    if (this.answered >= this.asked) return
    by("busy").hidden = false
    say(by("busy-text"), text)
    if (fraction === null) by("progress").removeAttribute("value")
    else by("progress").value = fraction
  }

  finish(asked, state) {
    if (asked < this.asked) return
    this.answered = asked
    clearTimeout(this.patience)
    by("busy").hidden = true
    document.body.dataset.state = state
    if (this.waiting) this.ask()
  }

  on_checked({asked, errors, positions}) {
    this.form.follow(positions)
    if (asked < this.asked) return
    this.form.mark(errors)
    if (Object.keys(errors).length) {
      say(by("status"), "Some inputs are not allowed; the results are those of the last case.")
      this.finish(asked, "wrong")
    }
  }

  on_known(known) {
    if (known.asked < this.asked) return
    by("coefficients").replaceChildren(table(["symbol", "meaning", "value", "equation"], known.coefficients, "Transport coefficients"))
    by("numbers").replaceChildren(table(["number", "value", "equation"], known.numbers, "The seven numbers"))
    by("closure-table").replaceChildren(table(["symbol", "coefficient", "exact", "printed", "verdict"], known.closures, "Closure coefficients"))
    say(by("regime"), known.regime)
    // what the table knows at once stands until the runs have an answer of their own
    if (known.advice && (!this.advised || known.advice.model === "none")) this.answer(known.advice)
  }

  on_progress({asked, model, fraction, steps}) {
    if (asked < this.asked) return
    if (performance.now() - this.began > PATIENCE) {
      this.busy(`The ${model} model: ${Math.round(100 * fraction)} %, ${steps} steps`, fraction)
    }
  }

  on_frame(frame) {
    if (frame.asked === this.asked) this.frame = frame
  }

  on_run(run) {
    if (run.asked !== this.asked) return
    this.runs.set(run.model, run)
    if (performance.now() - this.began > PATIENCE) {
      this.busy(`The ${run.model} model is done; the others follow. First runs take some seconds.`, null)
    }
  }

  on_profiles({asked, model, values}) {
    if (asked !== this.asked) return
    this.values.set(model, values)
    // what takes long is shown as it comes
    if (performance.now() - this.began > LONG) this.draw()
  }

  draw() {
    if (!this.frame || !this.values.size) return
    const order = this.form.values().models.filter((name) => this.values.has(name))
    this.drawn = {frame: this.frame, asked: this.asked}
    for (const id of ["budget-model", "download-model"]) {
      const select = by(id), before = select.value
      select.replaceChildren(...order.map((name) => el("option", {value: name}, name)))
      if (order.includes(before)) select.value = before
    }
    this.profiles.take(this.frame, new Map(order.map((name) => [name, this.values.get(name)])), this.runs)
  }

  on_drawn({asked}) {
    if (asked !== this.asked) return
    this.draw()
    document.body.dataset.drawn = asked
  }

  on_done({asked, advice, warnings, seconds}) {
    if (asked !== this.asked) return
    this.advised = true
    this.answer(advice)
    by("warnings").replaceChildren(...(warnings.length ? [el("details", {open: warnings.length < 3},
      el("summary", {}, `${warnings.length} warning${warnings.length > 1 ? "s" : ""}`),
      el("ul", {}, ...warnings.map((sentence) => el("li", {}, sentence))))] : []))
    document.body.dataset.seconds = seconds.toFixed(3)
    document.body.dataset.asked = asked
    say(by("status"), `${advice.headline} ${advice.correlations}`)
    this.finish(asked, "done")
  }

  answer(advice) {
    say(by("headline"), advice.headline)
    say(by("correlations"), advice.correlations)
    say(by("when"), advice.when)
    by("reasons").replaceChildren(...advice.reasons.map((sentence) => el("li", {}, sentence)))
    const rows = advice.rows.map(({model, text, error, suits}) => {
      const size = error ? Math.min(Math.max((Math.log10(error) + 4) / 4, 0.02), 1) : 0
      const best = model === advice.model
      return [
        best ? el("strong", {}, `${model} ◀ take this`) : model,
        el("span", {class: "bar"}, el("span", {class: suits ? "good" : "bad", style: `width: ${100 * size}%`})),
        text || "–", error === null ? "–" : suits ? "✓ yes" : "✗ no"]
    })
    by("rows").replaceChildren(table(
      ["model", "error of the mean charge", "(bars: logarithmic)", `within ${100 * advice.tolerance} %`], rows,
      advice.origin === "table" ? "Errors from the table of the package" : "Errors against the full model"))
  }

  on_map(found) {
    if (found.asked >= this.asked - 1) this.map.take(found, found.asked === this.asked && !this.waiting)
  }

  wantBudget(resting) {
    if (!resting || !this.drawn) return
    clearTimeout(this.budgetTimer)
    this.budgetTimer = setTimeout(() => this.send("budget", {
      model: by("budget-model").value, frame: this.profiles.index}), PAUSE)
  }

  on_budget(found) {
    if (!this.drawn || found.asked !== this.drawn.asked) return
    const {x, units, axis} = this.drawn.frame
    drawBudget(found, x, this.profiles.timeText(), units === "si" ? `${axis} in m` : `${axis}/L`)
  }

  on_file({name, type, content}) {
    const address = URL.createObjectURL(new Blob([content], {type}))
    const link = el("a", {href: address, download: name})
    link.click()
    setTimeout(() => URL.revokeObjectURL(address), 10000)
    say(by("status"), `${name} was handed to the browser.`)
  }

  on_cancelled({asked}) {
    say(by("status"), "Cancelled; the results are those of the last case.")
    this.finish(asked, "cancelled")
  }

  on_failure({asked, sentence}) {
    const node = by("failure")
    node.hidden = false
    say(node, sentence)
    this.finish(asked, "failed")
  }
}

const THEMES = ["system", "light", "dark"]

function theme(name) {
  if (name === "system") delete document.documentElement.dataset.theme
  else document.documentElement.dataset.theme = name
  by("theme").textContent = `Theme: ${name}`
  localStorage.setItem("triboflux-theme", name)
}

theme(THEMES.find((name) => name === localStorage.getItem("triboflux-theme")) ?? "system")
by("theme").addEventListener("click", () => {
  const now = localStorage.getItem("triboflux-theme")
  theme(THEMES[(THEMES.indexOf(now) + 1) % THEMES.length])
})
if (window.tribofluxModel) new Page(window.tribofluxModel)
else window.addEventListener("triboflux", () => new Page(window.tribofluxModel), {once: true})
