from xml.etree import ElementTree as Xml

import numpy as np
import pytest
from hypothesis import given, settings

from hopping_leg.errors import RobotError
from hopping_leg.io import replace_at
from hopping_leg.robot import JOINTS, dynamics, get_spec, kinematics, load_robot, to_urdf
from hopping_leg.robot.importing import imported_robot, read_values
from hopping_leg.robot.planar_leg import read_leg
from hopping_leg.robot.robot_files import robot_from_tree, shipped_robots
from tests.doc_pages import ROOT
from tests.robot.legs import SEEDS, random_robot, random_state

EXAMPLE = (ROOT / "examples/leg.urdf").read_text()
LEG = to_urdf(load_robot("legv2"))


def made(path, text, motors=("qdd100",), values=(), names=()):
    """Return the tables of a robot file that an XML text describes."""
    path.write_text(text)
    return imported_robot(read_leg(path, *names), str(path), motors, dict(values))[0]


def imported(*args, **options):
    """Return the robot that an XML text describes."""
    return robot_from_tree(made(*args, **options), "its file")


def assert_same_motion(robot, other, rng, rtol=1e-9):
    """Check mass matrix, forces, friction, stops and the foot's place in random states."""
    _, _, q, qd = random_state(rng, 5)
    for law in (dynamics.mass_matrix, dynamics.gravity_force, kinematics.foot_position):
        np.testing.assert_allclose(law(other, q), law(robot, q), rtol=rtol, atol=1e-11)
    bias = dynamics.bias_force(robot, q, qd)
    np.testing.assert_allclose(dynamics.bias_force(other, q, qd), bias, rtol=rtol, atol=1e-9)
    for name in ("friction", "damping", "stop_lower", "stop_upper"):
        expected = robot.of_joints(name)
        np.testing.assert_allclose(other.of_joints(name), expected, rtol=rtol, atol=1e-9)


def drawn_urdf(robot, rng):
    """Return a URDF whose joints' signs and zeros, plane and offsets beside it are drawn."""
    yaw, zeros = rng.uniform(-np.pi, np.pi), (rng.uniform(-2, 2), rng.uniform(-2.5, -0.2))
    forward, normal = [np.cos(yaw), np.sin(yaw), 0], np.array([np.sin(yaw), -np.cos(yaw), 0])
    angles = np.cumsum(zeros)[:, None]
    along = np.cos(angles) * [0, 0, -1] + np.sin(angles) * forward
    hip, knee, foot = rng.uniform(-0.1, 0.1, 3)[:, None] * normal
    knee, foot = knee + robot.thigh.length * along[0], foot + robot.shank.length * along[1]
    root = Xml.Element("robot", name="drawn")

    def add(parent, tag, **values):
        texts = {k: v if isinstance(v, str) else " ".join(map(repr, v)) for k, v in values.items()}
        return Xml.SubElement(parent, tag, texts)

    def add_link(name, mass, com, tensor):
        inertial = add(add(root, "link", name=name), "inertial")
        add(inertial, "origin", xyz=com.tolist())
        add(inertial, "mass", value=[mass])
        (xx, xy, xz), (_, yy, yz), (_, _, zz) = tensor.tolist()
        add(inertial, "inertia", ixx=[xx], iyy=[yy], izz=[zz], ixy=[xy], ixz=[xz], iyz=[yz])

    def add_joint(name, kind, parent, child, place, axis):
        joint = add(root, "joint", name=name, type=kind)
        add(joint, "parent", link=parent)
        add(joint, "child", link=child)
        add(joint, "origin", xyz=place.tolist())
        add(joint, "axis", xyz=axis.tolist())
        return joint

    for name in ("stand", "toe"):
        add(root, "link", name=name)
    add_link("base", robot.base.mass, hip, np.eye(3))
    add_joint("slide", "prismatic", "stand", "base", np.zeros(3), np.eye(3)[2])
    for k, (name, parent, place) in enumerate((("thigh", "base", hip), ("shank", "thigh", knee))):
        link, joint, sign = getattr(robot, name), (robot.hip, robot.knee)[k], rng.choice([-1, 1])
        ends = sorted(float(sign * (e - zeros[k])) for e in (joint.stop_lower, joint.stop_upper))
        added = add_joint(f"{name}_joint", "revolute", parent, name, place, sign * normal)
        add(added, "limit", lower=ends[:1], upper=ends[1:], effort="20", velocity="30")
        add(added, "dynamics", friction=[joint.friction], damping=[joint.damping])
        tensor = link.inertia * (np.eye(3) - 0.9 * np.outer(along[k], along[k]))
        add_link(name, link.mass, link.com * along[k] + 0.03 * normal, tensor)
    add_joint("end", "fixed", "shank", "toe", foot, np.eye(3)[0])
    return Xml.tostring(root, encoding="unicode")


@settings(max_examples=40, deadline=None)
@given(SEEDS)
def test_it_comes_back_whatever_signs_zeros_and_plane_a_file_has(tmp_path_factory, seed):
    rng = np.random.default_rng(seed)
    robot = random_robot(rng)
    robot = replace_at(robot, "knee.stop_upper", 0.0)  # else nobody knows where it bends
    other = imported(tmp_path_factory.mktemp("leg") / "leg.urdf", drawn_urdf(robot, rng))
    for joint in JOINTS:  # nothing in the file tells the armature
        robot = replace_at(robot, f"{joint}.armature", getattr(other, joint).armature)
    assert_same_motion(robot, other, rng)


@pytest.mark.parametrize("form", ["urdf", "mjcf"])
@pytest.mark.parametrize("name", [name for name in shipped_robots() if name.startswith("leg")])
def test_a_leg_comes_back_from_what_is_exported_of_it(tmp_path, name, form):
    robot, spec = load_robot(name), get_spec(load_robot(name))
    spec.compile()
    armatures = {f"{joint}.armature": getattr(robot, joint).armature for joint in JOINTS}
    text, values = (to_urdf(robot), armatures) if form == "urdf" else (spec.to_xml(), {})
    other = imported(tmp_path / "leg.xml", text, values=values)  # MuJoCo writes six digits
    assert_same_motion(robot, other, np.random.default_rng(0), rtol=1e-4)
    np.testing.assert_allclose(other.of_joints("armature"), robot.of_joints("armature"), rtol=1e-4)
    assert (other.rail, other.foot) == (robot.rail, robot.foot)


def test_mjcf_is_read_with_defaults_degrees_and_without_its_meshes(tmp_path):
    text = """<mujoco><compiler angle="degree" meshdir="nowhere"/>
    <default><default class="looks"><geom type="mesh" contype="0" mass="0"/></default></default>
    <asset><mesh name="tube" file="tube.stl"/></asset>
    <worldbody><geom type="plane" size="1 1 1"/>
      <body name="base"><joint type="slide" axis="0 0 1"/><geom size="0.05" mass="1"/>
        <body name="upper"><joint name="hip" axis="0 1 0" range="-90 45"/>
          <inertial pos="0 0 -0.1" mass="0.5" diaginertia="1e-3 1e-3 1e-4"/>
          <geom class="looks" mesh="tube"/>
          <body pos="0 0 -0.2"><joint name="knee" axis="0 1 0" range="10 150" ref="10"/>
            <geom type="capsule" fromto="0 0 0 0 0 -0.18" size="0.012" mass="0.1"/>
    </body></body></body></worldbody>
    <actuator><motor joint="hip" gear="2" ctrlrange="-5 5"/></actuator></mujoco>"""
    robot = imported(tmp_path / "leg.xml", text)
    lengths = robot.thigh.length, robot.shank.length, robot.foot.radius
    assert (*lengths, robot.hip.torque_limit) == pytest.approx((0.2, 0.18, 0.012, 10))
    assert (robot.hip.stop_lower, robot.hip.stop_upper) == pytest.approx(np.radians([-45, 90]))
    assert (robot.knee.stop_lower, robot.knee.stop_upper) == pytest.approx(np.radians([-140, 0]))


def test_what_mass_lies_beside_a_link_is_told_and_its_inertia_about_the_joint_kept(tmp_path):
    robot = load_robot("legv2")
    text = LEG.replace('xyz="0 0 -0.04477"', 'xyz="0.01 0 -0.04477"')
    tree = made(tmp_path / "leg.urdf", text)
    assert "10 mm beside the line" in tree["shank"]["com"]["source"]
    about_knee = robot.shank.inertia + robot.shank.mass * (robot.shank.com**2 + 0.01**2)
    other = robot_from_tree(tree, "its file").shank
    assert other.inertia + other.mass * other.com**2 == pytest.approx(about_knee)


def test_what_is_given_goes_before_the_file_and_the_file_before_the_motor(tmp_path):
    values = read_values(("knee.belt_ratio=1.5", "motor.rated_torque=5"))
    other = imported(tmp_path / "leg.urdf", LEG, ("ak80-9", "ak80-6"), values)
    assert (other.hip.motor.gear_ratio, other.knee.motor.gear_ratio) == (9.0, 6.0)
    assert other.knee.belt_ratio == 1.5
    assert other.knee.motor.torque_limit == 12.0, "the motor's peak: the file asks for 20 / 1.5"
    assert other.hip.torque_limit == load_robot("legv2").hip.torque_limit
    assert [joint.motor.rated_torque for joint in (other.hip, other.knee)] == [5.0, 5.0]


@pytest.mark.parametrize(
    ("text", "names", "sentence"),
    [
        ("<robot>", (), "no element found"),
        ("<mujoco>" * 1000 + "</mujoco>" * 1000, (), "nesting is too deep"),
        ('<robot xmlns:xacro="x"><xacro:include/></robot>', (), "expand it first: xacro"),
        (LEG.replace('"knee" type="revolute"', '"knee" type="fixed"'), (), "are: 'hip'."),
        (LEG.replace("0 -1 0", "0 0 1"), (), "are not level"),
        (LEG.replace('xyz="0 0 -0.15"', 'xyz="0 0 0"'), (), "turn about one axis"),
        (LEG, ("hp",), "--hip: There is no hinge 'hp'. Did you mean 'hip'?"),
        (LEG.replace('<child link="shank"', '<child link="shin"'), (), "MuJoCo reads"),
        (LEG.replace('value="0.11794"', 'value="heavy"'), (), "Element 'mass'"),
        (LEG.replace('radius="0.01"', 'radius="nan"'), (), "nan size"),
        ('<mujoco><include file="/etc/passwd"/></mujoco>', (), "Include error"),
        ('<mujoco><asset><mesh name="m"/></asset><worldbody><body name="a"><joint/>'
         '<geom type="mesh" mesh="m"/></body></worldbody></mujoco>',
         (), "body 'a' weighs what its mesh 'm' weighs"),
    ],
)  # fmt: skip
def test_what_cannot_be_read_is_said_with_what_was_found(tmp_path, text, names, sentence):
    with pytest.raises(RobotError, match=r".") as error:
        imported(tmp_path / "leg.xml", text, names=names)
    assert sentence in str(error.value)


def test_an_inertia_that_no_mass_has_is_told_with_what_makes_it_one(tmp_path):
    inertia = 'ixx="0.0012629" iyy="{}" izz="{}" ixy="0" ixz="0" iyz="0"'
    text = LEG.replace(inertia.format("0.0012629", "1e-9"), inertia)
    with pytest.raises(RobotError, match=r": 'thigh' has 0\.0001, 0.*, 0\.00146 \(add ") as error:
        imported(tmp_path / "leg.urdf", text.format("0.00146", "0.0001"))
    assert "shank" not in str(error.value)
    more = float(str(error.value).partition("add ")[2].partition(")")[0])
    text = text.replace("0.0012629", repr(0.0012629 + more), 1)
    imported(tmp_path / "leg.urdf", text.format(0.00146 + more, 0.0001 + more))


def test_missing_numbers_are_named_with_the_option_that_gives_them(tmp_path):
    with pytest.raises(RobotError, match=r"hip.motor.gear_ratio.*--motor qdd100.*--set motor"):
        made(tmp_path / "leg.urdf", EXAMPLE, ())
    leg = read_leg(tmp_path / "leg.urdf")
    del leg.numbers["base.mass"]
    with pytest.raises(RobotError, match=r"say base.mass \(kg\); give each, e.g. --set base.mass"):
        imported_robot(leg, "leg", ("qdd100",))


def test_a_urdfs_mesh_without_inertial_weighs_nothing(tmp_path):
    mesh = '<collision><geometry><mesh filename="a.stl"/></geometry></collision>'
    text = EXAMPLE.replace('<link name="stand"/>', f'<link name="stand">{mesh}</link>')
    leg = imported(tmp_path / "leg.urdf", text)
    assert (leg.base.mass, leg.thigh.mass, leg.shank.mass) == pytest.approx((0.91, 0.795, 0.148))
    assert (leg.thigh.length, leg.shank.length, leg.foot.radius) == (0.17, 0.165, 0.014)
    (tmp_path / "leg.urdf").write_text(text.replace("prismatic", "fixed").replace("stand", "world"))
    free = read_leg(tmp_path / "leg.urdf")
    assert (free.doubts, len(free.notes), free.notes[2][:17]) == ([], 3, "No vertical slide")


def test_what_a_file_hardly_means_is_doubted(tmp_path):
    file = tmp_path / "leg.urdf"
    file.write_text(EXAMPLE)
    assert read_leg(file).doubts == []
    file.write_text(EXAMPLE.replace('value="0.42"', 'value="0"').replace('"2.5"', '"143"'))
    weightless, far = read_leg(file).doubts
    assert "'carriage' weighs nothing" in weightless
    assert "'knee_pitch' ends at 0 and 143 rad: in degrees?" in far
    file.write_text(EXAMPLE.replace('lower="0" upper="2.5"', 'lower="2.5" upper="0"'))
    assert "ends at 2.5 and 0 rad: taken in order." in read_leg(file).doubts[0]
    assert read_leg(file).numbers["knee.stop_lower"][0] == -2.5


def test_joints_that_are_not_the_legs_are_held_and_named(tmp_path):
    path = tmp_path / "leg.urdf"
    path.write_text(LEG.replace('name="foot_tip" type="fixed"', 'name="ankle" type="continuous"'))
    leg = read_leg(path, "hip", "knee", "foot")
    assert "side is a guess" in leg.notes[2], "nothing tells where the straight leg's knee bends"
    assert leg.notes[3:] == ["Joints held in the zero posture: ankle."]
