"""The table of tie points."""

from __future__ import annotations

from typing import Any

import numpy as np
from qgis.PyQt.QtCore import QAbstractTableModel, QModelIndex, Qt, pyqtSignal

from .translation import mark, tr

HEADERS = (
    mark("Use"),
    mark("Point"),
    mark("Residual (px)"),
    mark("Score"),
    mark("Role"),
    mark("By hand"),
)
_USE, _POINT, _RESIDUAL, _SCORE, _ROLE, _EDITED = range(len(HEADERS))
# What a column is sorted by, as opposed to what it shows.
SORT_ROLE = Qt.ItemDataRole.UserRole


class PointTable(QAbstractTableModel):
    """A review's points with their residuals; the first column switches a point off and on."""

    switched = pyqtSignal(int, bool)

    def __init__(self, parent: Any = None) -> None:
        super().__init__(parent)
        self._review: Any = None
        self._residuals = np.zeros(0)

    def show_review(self, review: Any, residuals: Any) -> None:
        """Show another state of the points."""
        same = self._review is not None and len(review.points) == len(self._review.points)
        if not same:
            self.beginResetModel()
        self._review, self._residuals = review, residuals
        if not same:
            self.endResetModel()
        elif self.rowCount():
            last = self.index(self.rowCount() - 1, len(HEADERS) - 1)
            self.dataChanged.emit(self.index(0, 0), last)

    def rowCount(self, parent: QModelIndex = QModelIndex()) -> int:  # noqa: B008
        return 0 if self._review is None or parent.isValid() else len(self._review.points)

    def columnCount(self, parent: QModelIndex = QModelIndex()) -> int:  # noqa: B008
        return len(HEADERS)

    def headerData(self, section: int, orientation: Any, role: int = 0) -> Any:
        across = orientation == Qt.Orientation.Horizontal
        shown = across and role == Qt.ItemDataRole.DisplayRole
        return tr(HEADERS[section]) if shown else None

    def flags(self, index: QModelIndex) -> Any:
        checkable = index.column() == _USE
        flags = Qt.ItemFlag.ItemIsEnabled | Qt.ItemFlag.ItemIsSelectable
        return flags | Qt.ItemFlag.ItemIsUserCheckable if checkable else flags

    def data(self, index: QModelIndex, role: int = 0) -> Any:
        row, column = index.row(), index.column()
        if role == Qt.ItemDataRole.CheckStateRole and column == _USE:
            checked, unchecked = Qt.CheckState.Checked, Qt.CheckState.Unchecked
            return checked if self._review.points.used[row] else unchecked
        if role == Qt.ItemDataRole.ToolTipRole:
            return str(self._review.points.state[row])
        if role not in (Qt.ItemDataRole.DisplayRole, SORT_ROLE):
            return None
        value = self._value(row, column)
        if role == SORT_ROLE:
            return value
        if isinstance(value, float):
            return f"{value:.2f}" if np.isfinite(value) else "–"
        return "" if column == _USE else value

    def _value(self, row: int, column: int) -> Any:
        points = self._review.points
        if column == _USE:
            return int(points.used[row])
        if column == _POINT:
            return row + 1
        if column in (_RESIDUAL, _SCORE):
            values = self._residuals if column == _RESIDUAL else points.score
            return float(values[row]) if row < len(values) else float("nan")
        if column == _ROLE:
            return tr("check") if points.is_check[row] else tr("fit")
        return tr("yes") if self._review.edited[row] else ""

    def setData(self, index: QModelIndex, value: Any, role: int = 0) -> bool:
        if role != Qt.ItemDataRole.CheckStateRole or index.column() != _USE:
            return False
        self.switched.emit(index.row(), Qt.CheckState(value) == Qt.CheckState.Checked)
        return True
