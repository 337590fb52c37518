"""The table of tie points."""

from __future__ import annotations

from typing import Any

import numpy as np
from qgis.PyQt.QtCore import (
    QAbstractTableModel,
    QModelIndex,
    Qt,
    pyqtSignal,
)
from qgis.PyQt.QtWidgets import QAbstractItemView, QTableView

from .compat import RIGHT
from .translation import mark, tr

HEADERS = (
    mark("Use"),
    mark("Point"),
    mark("Residual (px)"),
    mark("Score"),
    mark("Role"),
    "✎",
)
ROLES = (mark("fit"), mark("check"))
_USE, _POINT, _RESIDUAL, _SCORE, _ROLE, _EDITED = range(len(HEADERS))
# Widest contents of the columns, besides their headings; and space around texts and for the sort
# arrow, in screen pixels.
_WIDEST = ("", "0000", "00.00", "000.00", "", "")
_SPACE_PX, _ARROW_PX = 12, 16


class PointTable(QAbstractTableModel):
    """A review's points with their residuals; the first column switches a point off and on."""

    switched = pyqtSignal(int, bool)

    def __init__(self, parent: Any = None) -> None:
        super().__init__(parent)
        self._review: Any = None
        self._residuals = np.zeros(0)
        self._sorted_by, self._descending = _RESIDUAL, True
        # Points in the order of the rows. The table sorts by itself because a proxy model would
        # request every value some twenty times.
        self._order = np.zeros(0, int)

    def show_review(self, review: Any, residuals: Any) -> None:
        """Show a new state of the points; None: no points."""
        known = review is not None and self._review is not None
        same = known and len(review.points) == len(self._review.points)
        self.layoutAboutToBeChanged.emit() if same else self.beginResetModel()
        self._review, self._residuals = review, residuals
        self._arrange()
        self.layoutChanged.emit() if same else self.endResetModel()

    def sort(self, column: int, order: Any = Qt.SortOrder.AscendingOrder) -> None:
        self.layoutAboutToBeChanged.emit()
        self._sorted_by, self._descending = column, order == Qt.SortOrder.DescendingOrder
        self._arrange()
        self.layoutChanged.emit()

    def _arrange(self) -> None:
        """Sort the points as requested; the selection moves with them."""
        if self._review is None:
            return
        values = self._sorted_values()
        before = self._order
        # NaN sorts last in both directions.
        self._order = np.argsort(-values if self._descending else values, kind="stable")
        if len(before) == len(self._order):
            row_of = np.argsort(self._order)
            held = self.persistentIndexList()
            moved = [self.index(int(row_of[before[i.row()]]), i.column()) for i in held]
            self.changePersistentIndexList(held, moved)

    def _sorted_values(self) -> Any:
        points = self._review.points
        if self._sorted_by == _POINT:
            return np.arange(len(points))
        if self._sorted_by in (_RESIDUAL, _SCORE):
            return self._residuals if self._sorted_by == _RESIDUAL else points.score
        flags = {_USE: points.used, _ROLE: points.is_check, _EDITED: points.edited}
        return np.asarray(flags[self._sorted_by], int)

    def point_at(self, row: int) -> int:
        """Return the point that a row of the table shows."""
        return int(self._order[row])

    def row_of(self, point: int) -> int:
        """Return the row that shows a point."""
        return int(np.flatnonzero(self._order == point)[0])

    def rowCount(self, parent: QModelIndex = QModelIndex()) -> int:  # noqa: B008
        return 0 if self._review is None or parent.isValid() else len(self._review.points)

    def columnCount(self, parent: QModelIndex = QModelIndex()) -> int:  # noqa: B008
        return len(HEADERS)

    def headerData(self, section: int, orientation: Any, role: int = 0) -> Any:
        if orientation != Qt.Orientation.Horizontal:
            return None
        if role == Qt.ItemDataRole.ToolTipRole and section == _EDITED:
            return tr("By hand")
        return tr(HEADERS[section]) if role == Qt.ItemDataRole.DisplayRole else None

    def flags(self, index: QModelIndex) -> Any:
        checkable = index.column() == _USE
        flags = Qt.ItemFlag.ItemIsEnabled | Qt.ItemFlag.ItemIsSelectable
        return flags | Qt.ItemFlag.ItemIsUserCheckable if checkable else flags

    def data(self, index: QModelIndex, role: int = 0) -> Any:
        row, column = self.point_at(index.row()), index.column()
        if role == Qt.ItemDataRole.CheckStateRole and column == _USE:
            checked, unchecked = Qt.CheckState.Checked, Qt.CheckState.Unchecked
            return checked if self._review.points.used[row] else unchecked
        if role == Qt.ItemDataRole.ToolTipRole:
            return str(self._review.points.state[row])
        if role == Qt.ItemDataRole.TextAlignmentRole and column in (_POINT, _RESIDUAL, _SCORE):
            return RIGHT
        if role != Qt.ItemDataRole.DisplayRole:
            return None
        value = self._value(row, column)
        if isinstance(value, float):
            return f"{value:.2f}" if np.isfinite(value) else "–"
        return value

    def _value(self, row: int, column: int) -> Any:
        points = self._review.points
        if column == _USE:
            return ""
        if column == _POINT:
            return row + 1
        if column in (_RESIDUAL, _SCORE):
            values = self._residuals if column == _RESIDUAL else points.score
            return float(values[row]) if row < len(values) else float("nan")
        if column == _ROLE:
            return tr(ROLES[int(points.is_check[row])])
        return "✎" if self._review.points.edited[row] else ""

    def setData(self, index: QModelIndex, value: Any, role: int = 0) -> bool:
        if role != Qt.ItemDataRole.CheckStateRole or index.column() != _USE:
            return False
        on = Qt.CheckState(value) == Qt.CheckState.Checked
        self.switched.emit(self.point_at(index.row()), on)
        return True


class PointView(QTableView):
    """Shows a `PointTable`, the largest residual first; a click on a heading sorts by it.

    Parameters
    ----------
    table
        The points.
    """

    # The point that was clicked.
    point_clicked = pyqtSignal(int)

    def __init__(self, table: PointTable) -> None:
        super().__init__()
        self._table = table
        self.setModel(table)
        self.setSortingEnabled(True)
        self.sortByColumn(_RESIDUAL, Qt.SortOrder.DescendingOrder)
        self.setSelectionBehavior(QAbstractItemView.SelectionBehavior.SelectRows)
        self.clicked.connect(lambda index: self.point_clicked.emit(table.point_at(index.row())))
        self._fit_sizes()

    def show_point(self, point: int) -> None:
        """Select the row of a point and scroll to it."""
        shown = self._table.index(self._table.row_of(point), 0)
        self.selectRow(shown.row())
        self.scrollTo(shown)

    def _fit_sizes(self) -> None:
        """Fit all columns into the view, only once, as points may be many and change often."""
        rows, columns = self.verticalHeader(), self.horizontalHeader()
        rows.hide()
        rows.setMinimumSectionSize(0)
        rows.setDefaultSectionSize(self.fontMetrics().height() + _SPACE_PX // 2)
        columns.setHighlightSections(False)
        columns.setMinimumSectionSize(0)
        width_of = self.fontMetrics().horizontalAdvance
        roles = max(map(tr, ROLES), key=width_of)
        for column, (heading, widest) in enumerate(zip(HEADERS, _WIDEST, strict=True)):
            shown = (tr(heading), roles if column == _ROLE else widest)
            arrow = _ARROW_PX if column == _RESIDUAL else 0
            columns.resizeSection(column, max(map(width_of, shown)) + _SPACE_PX + arrow)
        around = self.verticalScrollBar().sizeHint().width() + 2 * self.frameWidth()
        self.setMinimumWidth(columns.length() + around)
        columns.setStretchLastSection(True)
