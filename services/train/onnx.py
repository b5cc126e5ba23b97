"""``netboard train onnx``: weights in a format that other programs read."""

from pathlib import Path
from typing import Annotated

import typer

from netboard.services.options import examples

app = typer.Typer()


@app.command(epilog=examples("netboard train onnx trained/weights.json partner.onnx"))
def onnx(
    weights: Annotated[
        str, typer.Argument(metavar="FILE|learned", help="File of weights, or those that come with netboard.")
    ],
    output: Annotated[Path, typer.Argument(metavar="OUTPUT", help="New ONNX file.")],
) -> None:
    r"""Export weights as ONNX, and compare the exported network with netboard's own kernel.

    Needs additional libraries: pip install 'netboard\[onnx]'.
    """
    from netboard.participants.robots.learned import read_weights
    from netboard.training.onnx import largest_difference, write_onnx

    network, sha256 = read_weights(weights)
    write_onnx(output, network, sha256)
    typer.echo(f"{output}: differs from the kernel of netboard by {largest_difference(output, network):.1e} at most")
