"""Testing wing: the contract tests that a plug-in's author runs, those that netboard's own parts pass.

`device.DeviceContract` is for a device backend, `export_format.ExportFormatContract` for an export format. Derive a
test class, say how to make the thing, and run pytest, which is not among netboard's own requirements. Nothing else in
netboard imports this wing.
"""
