"""What a reader sees of a page, in a real browser: headless Chromium, without a network."""

import html
import json
import re
import shutil
import subprocess
from dataclasses import dataclass

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")

# The page in frames as wide as the screens: a window cannot be made as narrow as a phone. Frames
# are of the same origin, so that their documents can be asked.
_STAND = """<!DOCTYPE html><html><head><meta charset="utf-8"><style>body {{ margin: 0 }}
iframe {{ border: 0; height: 1000px; display: block }}</style></head><body>{frames}
<pre id="seen"></pre><script>
addEventListener("load", () => {{
  const seen = [...document.querySelectorAll("iframe")].map((frame) => {{
    const page = frame.contentDocument, root = page.documentElement;
    return {{
      width_px: frame.clientWidth,
      page_px: root.scrollWidth,
      images: [...page.images].map((image) => [image.naturalWidth, image.clientWidth, image.alt]),
    }};
  }});
  document.getElementById("seen").textContent = JSON.stringify(seen);
}});
</script></body></html>"""
_FRAME = '<iframe style="width: {width_px}px" srcdoc="{page}"></iframe>'
_OPTIONS = (
    "--headless --no-sandbox --disable-gpu --disable-dev-shm-usage --hide-scrollbars "
    "--disable-background-networking --virtual-time-budget=20000 --enable-logging=stderr"
).split()


@dataclass
class Seen:
    """A page at a width."""

    width_px: int  # of the screen
    page_px: int  # wider than the screen where something sticks out
    images: list  # naturalWidth, clientWidth in px, and alt of each

    def complaints(self):
        """What a reader would miss; empty if all is well."""
        missing = [f"no image: {alt}" for natural, _, alt in self.images if not natural]
        missing += [f"hidden image: {alt}" for _, shown, alt in self.images if not shown]
        if self.page_px > self.width_px:
            missing.append(f"page of {self.page_px} px on a screen of {self.width_px} px")
        return missing


def look(text, folder, widths_px):
    """Show a page's text on screens of some widths; folder: for what the browser writes.

    Returns what is seen on each, and what the page has said in the console, where it should say
    nothing.
    """
    page = html.escape(text)
    frames = "".join(_FRAME.format(width_px=width_px, page=page) for width_px in widths_px)
    stand = folder / "stand.html"
    stand.write_text(_STAND.format(frames=frames), encoding="utf-8")
    own = [f"--user-data-dir={folder}/chromium", "--window-size=1400,1000"]
    command = [CHROMIUM, *_OPTIONS, *own, "--dump-dom", stand.as_uri()]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60)
    seen = re.search(r'<pre id="seen">(.+?)</pre>', done.stdout, re.DOTALL)
    assert seen, f"Chromium has not shown the page:\n{done.stderr[-2000:]}"
    console = [line for line in done.stderr.splitlines() if "CONSOLE" in line]
    return [Seen(**one) for one in json.loads(html.unescape(seen[1]))], console
