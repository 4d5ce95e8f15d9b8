"""P1's expedition log examiner (2.2.1) as a page in the browser.

    log --profile, reference--> Drive --analysis, signals, totals--> arrays --decimate--> figures --> page

All but `page` and `server` are pure functions of a `Drive`; the browser moves the cursor by itself.
"""
