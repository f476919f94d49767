"""The Export folder: what is on the page, as files in the person's downloads."""

from __future__ import annotations

import io
from collections.abc import Callable

import viser

from quadsim.record.archive import load_run
from web.competitor import Competitor, named, stored_competitor
from web.exports import telemetry_csv, zipped
from web.recording import record
from web.session import Session

SHOT_TIMEOUT = 30.0  # [s] for a browser that draws in software


class ExportPanel:
    def __init__(self, gui: viser.GuiApi, session: Session):
        self._session = session
        does = {"page": self._page, "CSV": self._csv, "zip": self._zip, "PNG": self._png}
        with gui.add_folder("Export", expand_by_default=False):
            what = gui.add_button_group("", tuple(does), hint="page: animated, plays offline; PNG: the view")
        what.on_click(lambda event: self._send(event, does[event.target.value]))

    def _send(self, event: viser.GuiEvent, make: Callable[[viser.ClientHandle], tuple[str, bytes]]) -> None:
        """To the client that asked; what cannot be made is said there."""
        if event.client is None:
            return
        try:
            name, data = make(event.client)
        except (ValueError, RuntimeError, TimeoutError, OSError) as error:
            event.client.add_notification("Cannot export", str(error), auto_close_seconds=6.0, color="red")
            return
        event.client.send_file_download(name, data, save_immediately=True)

    def _kept(self) -> list[Competitor]:
        """The competitors of this race that are on the disk."""
        competitors = [competitor for competitor in self._session.snapshot.competitors if competitor.folder]
        if not competitors:
            raise ValueError("nothing is stored yet: a flight is kept when it ends")
        return competitors

    def _page(self, _: viser.ClientHandle) -> tuple[str, bytes]:
        competitors = named([stored_competitor(competitor.folder) for competitor in self._kept() if competitor.folder])
        return f"{competitors[0].folder.name}.html", record(competitors).encode()  # pyright: ignore[reportOptionalMemberAccess]

    def _csv(self, _: viser.ClientHandle) -> tuple[str, bytes]:
        folder = self._kept()[0].folder
        assert folder is not None
        return f"{folder.name}.csv", telemetry_csv(load_run(folder))

    def _zip(self, _: viser.ClientHandle) -> tuple[str, bytes]:
        folder = self._kept()[0].folder
        assert folder is not None
        return f"{folder.name}.zip", zipped(folder)

    def _png(self, client: viser.ClientHandle) -> tuple[str, bytes]:
        from PIL import Image

        height, width = client.camera.image_height, client.camera.image_width
        shot = client.get_render(height, width, transport_format="png", timeout=SHOT_TIMEOUT)
        data = io.BytesIO()
        Image.fromarray(shot).save(data, "PNG")
        return "race.png", data.getvalue()
