"""Definitions of the columns of a page, and of some words of its tables."""

from __future__ import annotations

from typing import Final

DEFINITIONS: Final = {
    "MSE": "Mean squared error in linear RGB of the fabric's own colours, over held-out queries and channels, the "
    "noise of the truth subtracted: MSE as measured minus noise. The truth's error is independent of the method's, "
    "so this estimates the method's own error. A row is the mean over its fabrics, each weighing alike.",
    "95 % interval": "Of the MSE, from the spread over queries. It says nothing of other fabrics or other trainings.",
    "noise": "Mean squared error of the truth in the same colours, as a share of the MSE as measured. The standard "
    "error of every component is a column of the data set; of tabulated answers, which state an error that covers, the "
    "square counts by a third: that is their mean squared error. Components are taken to be uncorrelated.",
    "× lower": "MSE of point sampling at 2 points over the method's, on the very fabrics that the method covers, with "
    "a 95 % interval (delta method). Above 1 the method is better.",
    "colour": "Relative RMSE of .3 (S_warp + S_weft) + .5 (C_warp + C_weft): root of the MSE over the mean of the "
    "truth, mean over fabrics; the same colour for every fabric.",
    "S warp, S weft, C warp, C weft": "Relative RMSE of each component: specular and diffuse, warp and weft.",
    "PSNR": "Peak signal-to-noise ratio of a scene's first frame as it is shown (times the exposure, cut at 1, sRGB "
    "codes): 10 log10 of 1 over the mean squared difference of lit pixels, in dB. Higher is better.",
    "SSIM": "Structural similarity of the same codes, Gaussian window, mean over channels and lit pixels. 1 is equal.",
    "FLIP": "Mean of the error map that NVIDIA's FLIP makes of the same codes: how different two pictures look to a "
    "viewer who flips between them on a screen. 0 is equal, 1 as different as can be.",
    "HDR-FLIP": "The same of linear light, over all exposures between those that fit the median and the brightest "
    "pixel.",
    "ΔE": "Mean difference of colour by CIEDE2000, of linear light cut at 1. About 1 can just be seen side by side.",
    "in scenes": "Colour: relative RMSE of the colour measure over the queries of all frames. Flicker and excess "
    "energy: as in the columns of that name, of the frames along the camera's way, where cloth is lit in every one. "
    "Small numbers beneath: 95 % intervals, blocks of neighbouring pixels drawn anew; they say how much the choice of "
    "pixels matters.",
    "noise of the truth": "Last row of a scene's table. Of MSE, the truth's mean squared standard error, which is "
    "already subtracted; elsewhere the score of the truth with as much noise added once more: about that of a perfect "
    "method. Smaller differences mean nothing.",
    "in the noise": "The mean squared error as measured is not larger than the noise of the truth: the difference "
    "is not above 0. It may still be as large as the upper end of its interval, and counts as "
    "that where the cheapest within an error is named.",
    "fallback share": "Share of a scene's queries out of the domain of a method (light or a viewer behind the cloth, "
    "cloth outside the range of its training), which the fallback answers: a node table.",
    "FovVideoVDP": "How visible the differences of the frames are on a display, flicker included, in "
    "just-objectionable differences (JOD): 10 is no visible difference. Shown where it was installed.",
    "flicker": "Temporal variance of the receding plane's luminance while the cloth slides by less than a pixel a "
    "frame, minus the truth's own, over the truth's squared mean. 0 is the truth; below 0 the method shows less of the "
    "motion than there is. Random methods draw new points in every frame.",
    "excess energy": "Power of the receding plane beyond half the Nyquist frequency (Hann window, mean over frames) "
    "minus the truth's, over the truth's squared mean. 0 is the truth.",
    "ns a query": "Median time of one query, everything included, of calls that take turns in one process after a "
    "warm-up; quartiles beside it. One call holds thousands of queries of every fabric, fewer of slow methods. On "
    "several threads each makes the whole call, as a renderer gives each of its threads a tile.",
    "ms a frame": "That time for 1920 × 1080 queries, one a pixel.",
    "ms to add a fabric": "Median time until a new fabric, or one with edited yarns, can be queried; nothing else "
    "delays the queries. None where every fabric is trained by itself.",
    "memory of a call": "Largest memory that a call on one thread adds to the process, answers included, beyond the "
    "bytes stored. Not of a GPU.",
    "× time": "That time over the time of point sampling at 2 points.",
    "front": "The methods that no other beats on both error (relative RMSE of the colour; in scenes, MSE) and time, in "
    "other plots on both axes. Only methods that cover the same fabrics are compared, without errors in the noise.",
    "eager-bf16, eager-fp16, compile, onnx, onnx-int8": "A trained network with the same weights in another runtime: "
    "products of matrices in half precision, compiled by torch, by ONNX Runtime, with weights and activations of 8 "
    "bits. Runtimes in single precision agree with the network itself to 1e-4.",
    "bytes stored": "Bytes that a renderer stores for one fabric: weights, textures and tables; mean over fabrics.",
}
"""Column by column, for the page."""
