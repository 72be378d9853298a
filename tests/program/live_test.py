# SPDX-License-Identifier: Apache-2.0
"""The page of egosgm live in a real browser. Environment as for program_case.py."""
import unittest

import numpy

from browser import CHROMIUM, Browser
from program_case import HAS_PACKAGE, egosgm


@unittest.skipUnless(CHROMIUM and HAS_PACKAGE, "no Chromium, or no Python package beside the program")
class LiveInBrowser(unittest.TestCase):
    def test_the_page_shows_what_is_newest_and_says_when_it_ends(self):
        self.assertIn("--side-by-side", egosgm("live", "--help").stdout)  # with it the package can be loaded
        from egosgm import live
        page, browser = live.Page(), Browser()
        self.addCleanup(browser.close)
        browser.call("Page.navigate", url=page.address)
        for width in (16, 24, 32):
            page.show(numpy.zeros((8, width, 3), numpy.uint8), f"{width} px")
            waits = f"(async () => {{ while (document.getElementById('state')?.textContent != '{width} px') await new Promise(r => setTimeout(r, 10)); " \
                    "return document.getElementById('picture').naturalWidth; })()"
            self.assertEqual(browser.evaluate(waits), width)
        self.assertEqual(browser.errors(), [])
        page.close()
        ended = "(async () => { while (!state.textContent.startsWith('ended: ')) await new Promise(r => setTimeout(r, 10)); return state.textContent; })()"
        self.assertEqual(browser.evaluate(ended), "ended: 32 px")
