"""What is changed in Exudyn's own examples before exudyn_examples.py runs them: our lines, and hardly anything else.

The examples run headless as they are, with EXUDYN_SUPPRESS_UI_WINDOW_OPEN=1 and MPLBACKEND=Agg. A patch that does not
match exactly once is an error that names the example: then Exudyn's script has changed, and this table has to.
"""

from dataclasses import dataclass

IMPORT = "import exudyn_romerr as romerr"
SOLVE = "mbs.SolveDynamic("
Edits = tuple[tuple[str, str], ...]


class PatchError(ValueError):
    """A patch does not match the script of an example exactly once."""


@dataclass(frozen=True)
class Truth:
    """The same script with more modes, same steps. both : edits of the coarse run too; lines : ours in both runs."""

    text: str
    lines: str
    more: Edits
    both: Edits = ()


@dataclass(frozen=True)
class Example:
    """A script of Exudyn's checkout, below main/pythonDev.

    lines : our lines by name of a view, put before the line that starts with `before`. repairs : what the script
    needs to run with this Exudyn at all; shorter : less to do. Both are there without our lines too. note : in words,
    what the numbers mean. parts : names of bodies, if the script has several in turn.
    """

    file: str
    lines: dict[str, str]
    before: str = SOLVE
    repairs: Edits = ()
    shorter: Edits = ()
    note: str = ""
    truth: tuple[Truth, ...] = ()
    parts: tuple[str, ...] = ()


def edited(name: str, source: str, edits: Edits) -> str:
    """Return the source with every (old, new) replaced; each old must be there exactly once."""
    for old, new in edits:
        found = source.count(old)
        if found != 1:
            raise PatchError(f"{name}: {old!r} is there {found} times, not once; has Exudyn's example changed?")
        source = source.replace(old, new)
    return source


def inserted(name: str, source: str, lines: str, before: str = SOLVE) -> str:
    """Return the source with our lines in front of the only line that starts with `before`, indented like it."""
    rows = source.split("\n")
    places = [i for i, row in enumerate(rows) if row.lstrip().startswith(before)]
    if len(places) != 1:
        raise PatchError(f"{name}: {len(places)} lines start with {before!r}, not one; has Exudyn's example changed?")
    at = places[0]
    indent = rows[at][: len(rows[at]) - len(rows[at].lstrip())]
    ours = [indent + line.strip() for line in (IMPORT, *lines.strip().split("\n"))]
    return "\n".join([*rows[:at], *ours, *rows[at:]])


def ours(outputs: str, fem: str = "fem", items: str = "objFFRF", i: str = "", **options: str) -> str:
    """Return our two lines for a body."""
    rest = "".join(f", {name}={value}" for name, value in options.items())
    return (
        f"flex{i} = romerr.floating_body({fem}, {items}{rest})\n"
        f"monitor{i} = romerr.attach(mbs, flex{i}, outputs=[{outputs}])"
    )


def at_node(node: str, name: str = "in the frame") -> str:
    """Return an output that a coupled scope allows: a node's displacement in y of the body's frame."""
    return f'romerr.node_displacement("{name}", node={node}, component="y")'


def all_at_node(node: str) -> str:
    """Return all components of it."""
    return f'romerr.node_displacement("in the frame, xyz", node={node})'


def cuboids(**options: str) -> str:
    """Return our lines for the two bodies of NGsolveCreateFFRFreducedOrder."""
    end = 'romerr.mean_displacement("end {}", nodes=boundaryNodesList[1], weights=boundaryWeightsList[1])'
    lines = (ours(end.format(i), "cuboidFemInterface", f"createFFRFObjectDict{i}", i, **options) for i in "01")
    return "\n".join(lines)


RIGID = {"interfaces": "'rigid'"}
BODY = "romerr.ElasticBody.from_fem(fem, rayleigh=(0, 0), reference=romerr.mean_motion({}, {}))"
# in a line of its own after the script's modes: those of the full model, interfaces free, in their place
FREE = f"{IMPORT}; fem.modeBasis = dict(matrix=romerr.modal_basis({BODY}, {{}}).V, type='NormalModes')"
SETUP = "# # Setup flexible body in exudyn\n"
LEFT = "nodesLeftPlane", "weightsLeftPlane"
DENSE = ("excludeRigidBodyModes = 6, useSparseSolver = True", "excludeRigidBodyModes = 6, useSparseSolver = False")
BOTH_VIEWS = "sensor, frame"  # in one run
TIP = "sensTipDispl, " + at_node("nTip")
ROTOR = "sDisp, " + all_at_node("nMid")
IN_COURSE = at_node("nMid", "mid") + ", " + at_node("nTip", "tip")
IN_THE_FRAME = {  # for short_runs.py
    "NGsolveCraigBampton": ours(at_node("nTip")),
    "CMSexampleCourse": ours(IN_COURSE, "femInterface"),
}
COURSE = "sMidDispl, sTipDispl, " + IN_COURSE
REDUCED = "cms = ObjectFFRFreducedOrderInterface(fem)"
MESHES = "['C3D4','C3D10','C3D8','C3D20','C3D20R']"
# both rotors: a body that is not attached would leave frozen inputs
BOTH = ours(at_node("nMid", "rotor 1")) + "\n" + ours(at_node("nMid", "rotor 2"), items="objFFRF2", i="2")

EXAMPLES = {
    "NGsolveCraigBampton": Example(
        "Examples/NGsolveCraigBampton.py",
        {BOTH_VIEWS: ours(TIP)},
        shorter=(("tEnd = 4", "tEnd = 1"),),
        note="gravity acts at once and nothing is damped: what the steps do not resolve rings for ever",
        truth=(
            Truth("RBE2, 60 modes", ours(TIP, **RIGID), ((" 8\n\n# #coarse1", " 60\n\n# #coarse1"),)),
            Truth("free, 80 modes", ours(TIP), (("#alternatives:", FREE.format(*LEFT, 80)),)),
        ),
    ),
    "NGsolveCreateFFRFreducedOrder": Example(
        "Examples/NGsolveCreateFFRFreducedOrder.py",
        {"frame": cuboids()},
        note="the script has no sensors: the ends of both bars, which hang on spherical joints",
        truth=(Truth("RBE2, 40 modes", cuboids(**RIGID), (("nEigenModes=6", "nEigenModes=40"),)),),
    ),
    "CMSexampleCourse": Example(
        "Examples/CMSexampleCourse.py",
        {BOTH_VIEWS: ours(COURSE, "femInterface")},
        shorter=(("tEnd = 2", "tEnd = 0.3"),),
        note="gravity acts at once and nothing is damped: what the steps do not resolve rings for ever",
        truth=(
            Truth(
                "free, 80 modes",
                ours(COURSE, "femInterface"),
                (
                    (
                        SETUP,
                        SETUP
                        + FREE.format("nodesLeft", "weightsNodesLeft", 80)
                        .replace("fem.", "femInterface.")
                        .replace("(fem,", "(femInterface,")
                        + "\n",
                    ),
                ),
            ),
        ),
    ),
    "NGsolveFFRF": Example(
        "Examples/NGsolveFFRF.py",
        {"frame": ours(at_node("boundaryNodesList[1][0]"))},
        repairs=(("import numpy as np", "import numpy as np; from math import sin, pi"),),
        note="despite its name a reduced body. 4 ms are too long for the modes; the rest alone is 3.2e-4 m",
    ),
    "NGsolveFFRFSlidingJoint": Example(
        "Examples/NGsolveFFRFSlidingJoint.py",
        {"sensor": ours("sPos", "femInterfaceC", "createFFRFObjectDictC")},
        repairs=(("['physicsLength']", "['length']"),),
        shorter=(("endTime=3", "endTime=0.02"),),
        note="the sensor is on the interface that holds the body's frame, whose motion frozen inputs leave out",
    ),
    "NGsolveModalAnalysis": Example("Examples/NGsolveModalAnalysis.py", {"sensor": ours("sensTipDispl")}),
    "NGsolvePostProcessingStresses": Example(
        "Examples/NGsolvePostProcessingStresses.py",
        {"frame": ours(at_node("nTip"))},
    ),
    "pendulumVerify": Example(
        "Examples/pendulumVerify.py",
        {"sensor": ours("sensTip", "femInterface")},
        before="mbs.SolveStatic(",
    ),
    "objectFFRFreducedOrderNetgen": Example(
        "Examples/objectFFRFreducedOrderNetgen.py",
        {"frame": ours(at_node("nTip"), "femInterface")},
        shorter=(("tEnd = 3", "tEnd = 0.3"),),
    ),
    "serialRobotFlexible": Example(
        "Examples/serialRobotFlexible.py",
        {"frame": ours(at_node("nodesPlane1[0]"))},
        repairs=(("VSum(measuredTorques)", "sum(measuredTorques)"), ("useFlexBody = False", "useFlexBody = True")),
    ),
    "objectFFRFreducedOrderTest": Example(
        "TestModels/objectFFRFreducedOrderTest.py",
        {BOTH_VIEWS: ours(ROTOR)},
        note="8 free eigenmodes, stiff supports, sudden unbalance at 50 turns/s",
        truth=(Truth("all 339 modes", ours(ROTOR), (("nModes = 8", "nModes = 339"), DENSE)),),
    ),
    "perfObjectFFRFreducedOrder": Example(
        "TestModels/perfObjectFFRFreducedOrder.py",
        {BOTH_VIEWS: ours(ROTOR)},
        shorter=(("tEnd = 2", "tEnd = 0.2"),),
    ),
    "objectFFRFreducedOrderAccelerations": Example(
        "TestModels/objectFFRFreducedOrderAccelerations.py", {"sensor": ours("sCMSdisp")}
    ),
    "objectFFRFreducedOrderStressModesTest": Example(
        "TestModels/objectFFRFreducedOrderStressModesTest.py", {"sensor": ours("sDisp")}
    ),
    "superElementRigidJointTest": Example("TestModels/superElementRigidJointTest.py", {"sensor": ours("sDisp")}),
    "superElementRigidJointTest, built-in": Example(
        "TestModels/superElementRigidJointTest.py",
        {"frame": BOTH},
        repairs=(
            ("cms.AddObjectFFRFreducedOrderWithUserFunctions(exu, ", "cms.AddObjectFFRFreducedOrder("),
            ("cms2.AddObjectFFRFreducedOrderWithUserFunctions(exu, ", "cms2.AddObjectFFRFreducedOrder("),
            ("[0,0,0], eulerParametersRef=eulerParameters0", "[0,0,0]"),
            ("[0,0,0.5], eulerParametersRef=eulerParameters0", "[0,0,0.5]"),
            ("UFforce=UFforceFFRFreducedOrder, UFmassMatrix=UFmassFFRFreducedOrder,", ""),
            ("UFforce=UFforceFFRFreducedOrder2, UFmassMatrix=UFmassFFRFreducedOrder2,", ""),
        ),
        note="the same with AddObjectFFRFreducedOrder for both bodies, as the message says",
        truth=(Truth("all 339 modes", BOTH, (("nModes = 20", "nModes = 339"), DENSE)),),
    ),
    "abaqusImportTest": Example(
        "TestModels/abaqusImportTest.py",
        {"sensor": ours("sDisp")},
        note="middle nodes of C3D10, C3D20 and C3D20R have the weight zero in the interfaces",
        truth=tuple(
            Truth(
                f"{mesh}, free, all modes",
                ours("sDisp"),
                ((REDUCED, FREE.format(*LEFT, "3*len(fem.GetNodePositionsAsArray())-6") + "; " + REDUCED),),
                ((MESHES, f"['{mesh}']"),),
            )
            for mesh in ("C3D8", "C3D20")
        ),
        parts=("C3D4", "C3D10", "C3D8", "C3D20", "C3D20R"),
    ),
    "NGsolveCMStest": Example(
        "TestModels/NGsolveCMStest.py",
        {BOTH_VIEWS: ours("sensTipDispl, " + all_at_node("nTip"))},
        note="rubber (1 MPa) under sudden gravity, no damping, 4 modes, a mesh made to be coarse",
        truth=(
            Truth(
                "free, all modes",
                ours("sensTipDispl, " + all_at_node("nTip")),
                (
                    (
                        REDUCED,
                        "fem.postProcessingModes = {}; "  # of other modes
                        + FREE.format(*LEFT, "3*len(fem.GetNodePositionsAsArray())-6")
                        + f"; {REDUCED}",
                    ),
                ),
            ),
        ),
    ),
    "objectFFRFTest2": Example(
        "TestModels/objectFFRFTest2.py",
        {"sensor": ours("sDisp")},
        note="ObjectFFRF has all coordinates of the mesh: nothing is reduced, so there is no error to bound",
    ),
}
