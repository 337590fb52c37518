"""The dialog that installs missing packages: it shows the command, asks, and runs it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from qgis.PyQt.QtCore import QProcess, Qt
from qgis.PyQt.QtWidgets import QDialog, QDialogButtonBox, QLabel, QPlainTextEdit, QVBoxLayout

from .dependencies import install_command
from .installing import as_typed, missing_requirements, pip_command, use_packages
from .translation import tr


class InstallDialog(QDialog):
    """Asks for consent, runs pip and shows its output.

    Parameters
    ----------
    folder
        Folder for the packages.
    finished
        Called when packages have been installed.
    """

    def __init__(self, folder: Path, finished: Any, parent: Any = None) -> None:
        super().__init__(parent)
        self.setWindowTitle(tr("GroundTie: install what is missing"))
        self.resize(680, 420)
        self._folder, self._finished = folder, finished
        self._command = pip_command(missing_requirements(), folder)
        self._process = QProcess(self)
        self._process.setProcessChannelMode(QProcess.ProcessChannelMode.MergedChannels)
        self._process.readyRead.connect(self._show_output)
        self._process.finished.connect(self._end)
        self._process.errorOccurred.connect(self._fail)
        self._build()

    def _build(self) -> None:
        layout = QVBoxLayout(self)
        self.text = QLabel(self._question())
        self.text.setWordWrap(True)
        self.text.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        self.log = QPlainTextEdit(as_typed(self._command) if missing_requirements() else "")
        self.log.setReadOnly(True)
        self.buttons = QDialogButtonBox(QDialogButtonBox.StandardButton.Cancel)
        self.install = self.buttons.addButton(tr("Install"), QDialogButtonBox.ButtonRole.ActionRole)
        self.install.setEnabled(bool(missing_requirements()))
        self.install.clicked.connect(self._start)
        self.buttons.rejected.connect(self.reject)
        for widget in (self.text, self.log, self.buttons):
            layout.addWidget(widget)

    def _question(self) -> str:
        names = missing_requirements()
        if not names:
            return tr("Nothing is missing: all Python packages that GroundTie needs are there.")
        return tr(
            "<p>GroundTie needs Python packages that this QGIS does not have: <b>{names}</b>.</p>"
            "<p><i>Install</i> downloads them from the Python Package Index by the command below, "
            "into a folder of GroundTie's own: {folder}. QGIS's own packages stay as they are and "
            "are preferred. Delete the folder to take everything back.</p><p>Or run the command "
            "yourself, or on Debian and Ubuntu: <code>{command}</code>"
        ).format(
            names=", ".join(names).replace("<", "&lt;"),
            folder=self._folder,
            command=install_command([n.split(">")[0].split("<")[0] for n in names], True),
        )

    def _start(self) -> None:
        self.install.setEnabled(False)
        self.log.appendPlainText("")
        self._process.start(self._command[0], self._command[1:])

    def _show_output(self) -> None:
        text = bytes(self._process.readAll()).decode("utf-8", "replace")
        self.log.appendPlainText(text.rstrip())

    def _fail(self, error: Any) -> None:
        if error == QProcess.ProcessError.FailedToStart:
            self.text.setText(
                tr("Python was not found: {} cannot be started.").format(self._command[0])
            )

    def _end(self, code: int, *_: Any) -> None:
        use_packages(self._folder)
        if code or missing_requirements():
            self.text.setText(tr("The packages were not installed; pip's reason stands below."))
            self.install.setEnabled(True)
            return
        self.text.setText(tr("All is installed. GroundTie's tools are ready."))
        self.buttons.button(QDialogButtonBox.StandardButton.Cancel).setText(tr("Close"))
        self._finished()

    def reject(self) -> None:
        """Close, and stop pip if it is running."""
        if self._process.state() != QProcess.ProcessState.NotRunning:
            self._process.kill()
            self._process.waitForFinished(3000)
        super().reject()
