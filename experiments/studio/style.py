
  ""How the page looks: one column on a telephone, two beside each other on a desk. Text passes WCAG AA on its ground."""

CSS = """
body { background: #f6f8fa; color: #1f2328; font-family: system-ui, sans-serif; }
.nicegui-content { padding: 0; width: 100%; align-items: stretch; }
.header { background: #ffffff; color: #1f2328; border-bottom: 1px solid #d0d7de; padding: 0 16px; gap: 16px;
  display: flex; align-items: center; flex-wrap: nowrap; min-height: 48px; box-shadow: none; }
.brand { font-weight: 700; white-space: nowrap; }
.tabs { min-width: 0; flex: 1 1 auto; color: #1f2328; }
.main { display: block; width: 100%; max-width: 1280px; margin: 0 auto; padding: 16px 16px 72px;
  box-sizing: border-box; }
.main > * { margin-bottom: 12px; }
.footer { background: #ffffff; color: #424a53; border-top: 1px solid #d0d7de; padding: 6px 16px; font-size: 13px; }
h2 { font-size: 17px; line-height: 1.4; font-weight: 650; margin: 20px 0 8px; letter-spacing: 0; }
.wrap-row { display: flex; flex-wrap: wrap; gap: 10px; align-items: center; }
.wrap-row .q-select, .wrap-row .q-field { min-width: 150px; }
.drop { width: 100%; max-width: 640px; border: 2px dashed #6e7781; }
.drop .q-uploader__header { background: #ffffff; color: #1f2328; }
.drop .q-uploader__title { white-space: normal; line-height: 1.3; font-size: 13px; }
.drop .q-uploader__list { display: none; }
.table { border-collapse: collapse; background: #fff; border: 1px solid #d0d7de; width: 100%; }
.table th, .table td { text-align: left; padding: 6px 10px; border-top: 1px solid #d8dee4; vertical-align: middle;
  font-weight: 400; }
.table thead th { font-weight: 600; border-top: none; }
.table th[scope=row] { font-weight: 600; white-space: nowrap; }
.scroll { overflow-x: auto; }
.choice { min-width: 140px; }
.light { display: inline-flex; gap: 6px; align-items: center; white-space: nowrap; font-weight: 600; }
.light .q-icon { font-size: 20px; }
.light-good { color: #116329; } .light-doubt { color: #7d4e00; } .light-bad { color: #b31d28; }
.light-none { color: #424a53; }
.message { display: flex; gap: 10px; align-items: flex-start; padding: 8px 12px; background: #fff;
  border: 1px solid #d0d7de;
  border-left-width: 5px; border-radius: 4px; white-space: pre-line; overflow-wrap: anywhere; }
.message .q-icon { font-size: 20px; flex: none; margin-top: 1px; }
.message-none .q-icon { display: none; }
.message-good { border-left-color: #116329; } .message-good .q-icon { color: #116329; }
.message-doubt { border-left-color: #9a6700; } .message-doubt .q-icon { color: #7d4e00; }
.message-bad { border-left-color: #b31d28; background: #fff5f5; } .message-bad .q-icon { color: #b31d28; }
.doing { display: flex; align-items: center; gap: 10px; font-weight: 600; }
.cards { display: grid; grid-template-columns: repeat(auto-fit, minmax(210px, 1fr)); gap: 12px; }
.card { background: #fff; border: 1px solid #d0d7de; border-radius: 6px; padding: 10px 14px; }
.card-title { font-size: 13px; color: #424a53; } .card-value { font-size: 26px; font-weight: 650; line-height: 1.3; }
.card-meaning { font-size: 13px; color: #424a53; overflow-wrap: anywhere; }
.chart { width: 100%; height: 300px; background: #fff; border: 1px solid #d0d7de; border-radius: 6px; padding: 8px;
  box-sizing: border-box; }
.chart.tall { height: 440px; } .chart.live { height: 440px; }
.command { background: #24292f; color: #f6f8fa; border-radius: 6px; padding: 8px 12px; margin-top: 18px; }
.command-title { font-size: 12px; color: #d0d7de; }
.command-row { display: flex; align-items: center; justify-content: space-between; gap: 8px; }
.command-row .q-btn { color: #f6f8fa !important; }
.command-text { font-family: ui-monospace, monospace; font-size: 13px; overflow-wrap: anywhere;
  white-space: pre-wrap; }
.split { display: grid; grid-template-columns: minmax(0, 1fr) 360px; gap: 20px; align-items: start; }
.split-main > * { margin-bottom: 10px; }
.split-side { max-height: calc(100vh - 120px); overflow-y: auto; padding-right: 6px; }
.readout { display: grid; grid-template-columns: 1fr 1fr; gap: 12px; }
.wide { width: 100%; } .inset { padding: 0 12px; }
.scene { width: 100%; max-width: 100%; overflow: hidden; border: 1px solid #d0d7de; border-radius: 6px;
  background: #fff; }
.effect { background: #fff; border: 1px solid #d0d7de; border-radius: 6px; padding: 8px 12px; margin-top: 10px; }
.effect-title { display: flex; justify-content: space-between; align-items: center; flex-wrap: nowrap; }
.slider { padding: 6px 0; } .slider-title { font-weight: 600; font-size: 14px; }
.slider-row { display: flex; flex-wrap: nowrap; align-items: center; gap: 16px; padding-left: 8px; }
.slider-track { flex: 1 1 auto; min-width: 60px; } .slider-number { width: 112px; flex: none; }
.verdict { background: #fff; border: 1px solid #d0d7de; border-left-width: 8px; border-radius: 6px;
  padding: 12px 16px; }
.verdict-good { border-left-color: #116329; } .verdict-doubt { border-left-color: #9a6700; }
.verdict-bad { border-left-color: #b31d28; }
.verdict-label { font-weight: 700; } .verdict-text { font-size: 18px; line-height: 1.45; }
.steps { padding-left: 28px; max-height: 320px; overflow-y: auto; }
:focus-visible { outline: 3px solid #0b5cad; outline-offset: 2px; }
@media (max-width: 900px) { .split { grid-template-columns: minmax(0, 1fr); } .split-side { max-height: none; } }
@media (max-width: 640px) {
  .header { flex-wrap: wrap; padding: 4px 8px 0; gap: 0; } .tabs { width: 100%; }
  .main { padding: 10px 10px 88px; }
  .stacked, .stacked tbody { display: block; }
  .stacked tr { display: grid; grid-template-columns: 1fr auto; border-top: 1px solid #d8dee4; padding: 6px 4px; }
  .stacked th, .stacked td { border: none; padding: 3px 6px; }
  .stacked td:last-child { grid-column: 1 / -1; order: 4; color: #424a53; font-size: 13px; }
  .stacked th { order: 1; } .stacked td:nth-child(3) { order: 2; }
  .stacked td:nth-child(2) { order: 3; grid-column: 1 / -1; }
  .chart.tall, .chart.live { height: 360px; } .card-value { font-size: 21px; }
}
"""
