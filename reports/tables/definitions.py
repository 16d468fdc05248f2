"""Definitions of the columns of a page, and of some words of its tables."""

from __future__ import annotations

from typing import Final

from reports.catalogue import METRICS

_WORDS: Final = {
    "95 % interval": "Of the MSE, from the spread over queries. It says nothing of other fabrics or other trainings.",
    "[ … ]": "The least and the most over the trainings of a network, which differ in their seed alone; the number "
    "beside it is their mean. × lower is the ratio to the mean MSE.",
    "( … )": "95 % interval over unseen fabrics of the geometric mean beside it: Student's t interval of the mean "
    "logarithm. It holds for fabrics drawn at random, as most of them are.",
    "noise": "Mean squared error of the truth in the same colours, as a share of the MSE as measured. The standard "
    "error of every component is a column of the data set, calibrated against true errors. Components are taken to be "
    "uncorrelated.",
    "× lower": "MSE of point sampling at 2 points over the method's, on the very fabrics that the method covers, with "
    "a 95 % interval (delta method). Above 1 the method is better.",
    "in scenes": "Colour: relative RMSE of the colour measure over the queries of all frames. Flicker and excess "
    "energy: as in the columns of that name, of the frames along the camera's way, where cloth is lit in every one. "
    "Small numbers beneath: 95 % intervals, blocks of neighbouring pixels drawn anew; they say how much the choice of "
    "pixels matters.",
    "noise of the truth": "Last row of a scene's table. Of MSE, the truth's mean squared standard error, which is "
    "already subtracted; elsewhere the score of the truth with as much noise added once more: about that of a perfect "
    "method. Smaller differences mean nothing.",
    "in the noise": "The mean squared error as measured is not larger than the noise of the truth: the difference is "
    "not above 0. It may still be as large as the upper end of its interval, and counts as that where the cheapest "
    "within an error is named.",
    "× time": "That time over the time of point sampling at 2 points.",
    "front": "The methods that no other beats on both error (relative RMSE of the colour; in scenes, MSE) and time, "
    "in other plots on both axes. Only methods that cover the same fabrics are compared; errors in the noise are left "
    "out.",
    "eager-bf16, eager-fp16, compile, onnx, onnx-int8": "A trained network with the same weights in another runtime: "
    "products of matrices in half precision, compiled by torch, by ONNX Runtime, with weights and activations of 8 "
    "bits. Runtimes in single precision agree with the network itself to 1e-4.",
}
"""Words and columns that are no metric."""


def definitions() -> dict[str, str]:
    """Return the definitions by the titles of columns: metrics of the catalogue first, then other words."""
    return {row.title: row.definition for row in METRICS.values() if row.definition} | _WORDS
