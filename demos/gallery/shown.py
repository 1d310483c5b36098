"""The demos of the gallery, in the order of its pages."""

from demos.gallery.entries import Entry, Further, Variant

ENTRIES = (
    Entry(
        "ring_throw",
        "A frog through a ring",
        """A soft frog, lying on its back, is thrown through a ring and has to end on its feet on a step. Of 60
evenly spread throws two do; a search with level 0 finds this one after 30 ([wedge.md](../wedge.md#search)),
and both finer levels keep it. It is refined as it was found: no finer level was searched.""",
        small={"vertices": (150, 300)},
        settings={"speed": 4.6059, "angle": 58.3774, "aim": 2.90129, "spin": 1.2504},
        view="follow:frog",
        slow=(0.3, 1.1),
        direct=True,
        moment=0.48,
    ),
    Entry(
        "ball_on_spike",
        "A ball on a spike",
        """A soft ball falls on a sharp spike, slightly off-centre. Which way it goes is decided by the smallest
difference: levels that are simulated on their own (`--method direct`) end at -0.39, +0.52, +0.40, -0.26
and -0.06 m. Refined progressively, all levels go where level 0 went.""",
        paper="2 and 10",
        small={},
        slow=(0.2, 0.6),
        size=(1200, 420),
        direct=True,
        moment=0.45,
    ),
    Entry(
        "heterogeneous",
        "Soft and stiff on a trampoline",
        """A worm of 2e4 Pa, a propeller of 2e10 Pa, three letters and a ball of soft and firm panels fall on a
trampoline. Three material laws, stiffnesses a million times apart, the same bounce on all levels. Linear
systems are solved directly here: conjugate gradients took 37 iterations a system on level 0. With a
propeller that spins (`--set spin=3`) Newton needs 11 to 15 iterations where 2 to 3 suffice without:
its straight steps stretch a stiff body that turns, and the line search shortens them.""",
        paper="16",
        small={"vertices": (25, 50), "dt": 0.02, "steps": 35},
        slow=(0.25, 0.65),
        size=(1260, 480),
        direct=True,
        moment=0.5,
    ),
    Entry(
        "rope_drop",
        "A rope falls in folds",
        """A rope falls on the ground and lies down in folds. On level 0 it is one element wide and kinks; finer levels
are smooth, and lie in the same folds. What interpolation alone gives, and how interpolants compare, is in
[methods.md](../methods.md).""",
        paper="11, 17 and 18",
        small={},
        slow=(0.2, 0.6),
        size=(1100, 480),
        direct=True,
        moment=0.51,
    ),
    Entry(
        "melt",
        "A tower melts and sets",
        """A tower of jelly softens from 1e5 Pa to 4e3 Pa, slumps under its own weight, and stands up again when it
sets: Young's modulus follows keys in time.""",
        small={"vertices": (30, 90), "dt": 0.02, "steps": 75},
        size=(800, 400),
        direct=True,
        moment=0.7,
    ),
    Entry(
        "worm",
        "A worm crawls",
        """Waves of contraction run along a worm, and friction with the floor does the rest. Without friction
(`--set mu=0`) the same waves lead nowhere.""",
        small={"vertices": (60, 150), "frequency": 2.0, "steps": 60},
        size=(1000, 260),
        direct=True,
        moment=1.0,
    ),
    Entry(
        "balloon",
        "A balloon between floor and ceiling",
        """A hollow ball is blown up until it is wedged between floor and ceiling, and let down again. The pressure
is a load by time. The ceiling is not drawn: it would hide the balloon.""",
        small={"subdivisions": (1, 2), "layers": (1, 1), "dt": 0.02, "steps": 60},
        size=(800, 400),
        direct=True,
        moment=0.7,
    ),
    Entry(
        "peel",
        "A strip peels off",
        """A strip glued to a ceiling is pulled down at one end. The glue is springs whose stiffness and
strength are divided by area; both levels have the same springs, and they break in the same order.""",
        small={"vertices": (60, 150), "steps": 60},
        slow=(0.1, 0.5),
        size=(800, 400),
        direct=True,
        moment=0.3,
    ),
    Entry(
        "catapult",
        "A catapult",
        """The arm's mesh is straight, and that is its shape without stress. It starts bent, on both levels by the
same function of place (`Body(start=...)`), is held so for a moment, and throws a ball into a bucket when it is
let go. Simulated on its own (`--method direct`), level 1's ball is up to 11 cm from that of level 0 on its way. As a
finer level of this shot it stays within millimetres.""",
        small={"vertices": (60, 150), "balls": (30, 60), "dt": 0.01, "steps": 100},
        slow=(0.1, 0.25),
        size=(1000, 460),
        direct=True,
        moment=0.25,
    ),
    Entry(
        "gripper",
        "A gripper lifts a ball",
        """Two fingers that a rig drives ([rig.md](../rig.md)) close on a soft ball, lift it by friction alone, and
hold it. The fingers are the same point cache on all levels, so the ball of every level is held alike. Without
friction (`--set mu=0`) it stays below.""",
        small={"vertices": (60, 150), "dt": 0.02, "steps": 70},
        turn=-25.0,
        slow=(0.25, 0.5),
        size=(800, 400),
        direct=True,
        moment=1.2,
    ),
    Entry(
        "donuts",
        "Glazed donuts",
        """What is drawn is not what is simulated ([render_meshes.md](../render_meshes.md)): a detailed surface with
a texture follows dough of some hundred vertices, on both levels. Both bodies have one mesh and its render mesh.""",
        small={"vertices": (150, 300), "detail": 48, "height": 0.34, "steps": 60},
        drawn=True,
        slow=(0.1, 0.4),
        size=(1000, 460),
        direct=True,
        moment=0.9,
    ),
    Entry(
        "extreme_shapes",
        "A gear and a seahorse over pegs",
        """Level 0 has some 70 vertices a body, the finest level more than 50 times as many: its outlines have
twenty thin teeth and twenty-two knobs that level 0 only hints at. Both shapes come to rest on the same
pegs on all levels. The outer part of each tooth of level 1 is bound to one
cell of level 0, another one for each tooth.""",
        paper="12",
        small={"vertices": (65, 200), "dt": 0.02, "steps": 60},
        size=(1080, 720),
        binding=True,
        direct=True,
        moment=1.1,
    ),
    Entry(
        "hollow_cube",
        "A ball in a hollow cube",
        """The limitation that the paper names: where a coarse level is solid, no body can be inside, and a hollow
fine level then falls into nonsense. `pdvol check demos/hollow_cube.py --set coarse=solid` finds it
before anything runs, names the level and both bodies, and says that the finer level keeps them apart.
The mend is a coarse level with a cavity of its own, as here. The cube is cut open to show the ball.""",
        paper="limitations",
        small={"steps": 40, "dt": 0.02},
        cut="z=0:cube",
        size=(1000, 460),
        direct=True,
        moment=0.5,
    ),
    Entry(
        "dice_and_wizard",
        "A gnome on a letter block",
        """On level 0 the block is a plain cube, on level 1 letters are cut deep into its faces. The gnome follows
the coarse animation, and settles into the letter that level 0 does not know. The block has 2e5 Pa here, and 1e8 Pa
[below](#a-stiff-block).""",
        paper="4",
        small={"vertices": (250, 500), "block": (216, 900), "dt": 0.02, "steps": 40},
        slow=(0.1, 0.4),
        size=(1000, 460),
        direct=True,
        moment=1.0,
        meeting=(0, 1),
        row="soft",
        further=(
            Further(
                "gaps",
                "How contact fits",
                """Both bodies are cut open through the letter. The colour is the gap to the nearest other surface.
Where fine meshes are only embedded, the gap that level 0 leaves between the gnome and the letter stays, or the
surfaces cross. Here contact acts on level 1 itself. [Below](#how-near-they-come) are the figures.""",
                view="1.68,1.02,1.02:0.0,0.41,-0.02",
                cut="x=0",
                size=(1100, 460),
                slow=(0.1, 0.4),
            ),
        ),
        variants=(
            Variant(
                "stiff",
                "A stiff block",
                """A block of 1e8 Pa keeps its shape, so the gnome alone deforms.""",
                {"soft": False},
            ),
        ),
    ),
    Entry(
        "jelly_bowl",
        "Jelly animals in a glass bowl",
        """A bear, a bunny and a frog are thrown at 6 m/s into a bowl. Level 0 decides who lands on whom; the finest
level adds faces, paws and the ripples of the impact. It has 24 times the vertices of level 0. Two other runs shared
the machine's two cores meanwhile, so seconds are upper bounds. [Below](#a-hundred-times-the-vertices) is the impact
with 177,726 vertices, 114 times those of its level 0.""",
        paper="19",
        small={"vertices": (150, 400), "dt": 0.01, "steps": 40},
        slow=(0.1, 0.5),
        size=(1260, 440),
        direct=True,
        moment=0.35,
        variants=(
            Variant(
                "impact",
                "A hundred times the vertices",
                """The same shot through its impact, with the paper's ratio between the finest level and level 0. All of
level 3 takes 40 minutes, and its process 3.8 GB of memory.""",
                {"vertices": (500, 2500, 12500, 55000), "steps": 20},
                direct=False,
            ),
        ),
    ),
    Entry(
        "bunny_noodles",
        "Bunny noodles",
        """Nine slices, shaped like a bunny, soft and thin as noodles, fall into a bowl that is smaller than they are.
They hang over its rim and fold over each other, on level 0, too. With two smoothed cells through its thickness a
strip like level 0 is 2.5 times as stiff in bending as a thin beam; with linear ones it would be 14 times.""",
        paper="3",
        small={"slices": 4, "vertices": (30, 60), "dt": 0.02, "steps": 22},
        settings={"feedback": 0.1},
        slow=(0.1, 0.5),
        size=(1260, 400),
        moment=1.1,
    ),
    Entry(
        "leaf_sheep",
        "Leaf sheep on a sea mushroom",
        """A current sweeps two leaf sheep off the caps of a sea mushroom. They meet over a stone and come to rest on
their feet. The sizes are those of the paper's first figure. All steps of level 0 (9,172 tetrahedra) take 81 s of
processor time, those of level 2 (410,057) 66 minutes: 49 times as long, where the paper has 120. The sheep end
in the same places: level 2 is 5.9 mm from level 0 then, and 1.1 cm if it is simulated directly, in 60 minutes.

Level 2 has 27 times the vertices of level 0, and 45 times its cells. One of its Newton iterations takes 35 times as
long: 34 times in assembly, 47 times in linear solves, and 15, 22 and 13 times in contact, collision detection and
the rest. It takes 8.7 iterations a step, and level 0 6.2, which gives 49 times. At c9566d7 it was 74 times. A linear
solve of level 2 took 41 iterations of conjugate gradients at 46b4b79. With level 0 as coarse space it takes 21.
Level 0 spends 47 % of its time in assembly and 36 % in linear solves, level 2 44 % and 47 %.

A preview there (`pdvol run --levels 0`, 220 steps, meshes kept from before) takes 86 s of wall time at ef6e631, on one
core of an AMD EPYC with nothing else to do, and took 110 s at 6ddca54: means of two runs each, in turn. Steps are 66 s
of it; the rest is start, fields for ParaView and a picture. At ac300c6 it took 93 s on one core, and 77 s with
`--ranks 2`, in the same minutes. Of two cores pdvol itself uses one below 4,000 vertices.""",
        paper="1",
        small={"vertices": ((500, 800), (250, 400)), "dt": 0.04, "steps": 110},
        view="-0.95,1.37,2.01:0.0,0.33,0.14",
        slow=(0.8, 2.4),
        size=(1260, 480),
        moment=1.68,
        direct=True,
    ),
    Entry(
        "ape",
        "A gorilla is thrown up",
        """A soft gorilla is held by its seat, its feet and one fist, and suddenly gets an upward velocity of 5 m/s.
It swings for eight seconds; little but the time steps takes energy out of it. Simulated each on its own, levels
lose their common motion within two seconds. Refined progressively, head and fist are in the same pose to the end.""",
        paper="8",
        small={"vertices": (120, 250), "steps": 60},
        slow=(0.0, 0.6),
        size=(1200, 460),
        direct=True,
        moment=0.3,
    ),
    Entry(
        "drop",
        "A bear cub falls on stones",
        """A bear cub falls, turning, on two round stones and the floor. `--set surface=FILE` drops any other closed
surface. Level 2 has ears, paws and a face; it lies where level 0 came to lie.""",
        paper="9",
        small={"vertices": (150, 300), "dt": 0.02, "steps": 35},
        slow=(0.25, 0.65),
        size=(1200, 440),
        direct=True,
        moment=0.5,
    ),
    Entry(
        "twist",
        "A bar is twisted and let go",
        """The ends of a bar turn by 210 degrees in opposite directions within 0.7 s; then one is let go. Nothing
touches anything here, so this is the bare cost of a step: Newton needs as many iterations on all levels, and
the time of a step grows about as the number of vertices. The shape is smooth, and level 0 has it already.
The largest distances come right after the release, while the bar untwists fastest.""",
        paper="13",
        small={"cuts": ((8, 2), (12, 3)), "release": 0.15, "steps": 40},
        slow=(0.4, 1.0),
        size=(1000, 580),
        moment=0.68,
    ),
    Entry(
        "coil",
        "A bar is twisted into a coil",
        """The bar of [the page before](twist.md), whose ends are turned on at twice the speed, by 396 degrees each in
opposite directions. At about 350 degrees each it bends sideways into a coil, and its edges are pressed into its sides.
None of its levels crosses itself, and they coil to the same side. As long as the bar is straight, a step takes 3 to 5
Newton iterations on all levels. The finer a level, the earlier its sides wrinkle between the edges, and the harder
that is: the hardest step takes 55, 50, 99 and 300 iterations on levels 0 to 3. Level 3 touches itself from step 53 on,
in up to 10,600 contacts. That step and the next one take 12 of its 46 minutes.""",
        paper="13",
        small={"cuts": ((12, 3), (16, 4)), "speed": 800.0, "steps": 55},
        slow=(0.5, 0.66),
        size=(1000, 580),
        moment=0.65,
    ),
    Entry(
        "slit_array",
        "A block of slits",
        """A block that is cut into seven soft strips falls on the ground, in eight levels and with time steps of
0.04 s. The strips buckle and lie down on each other. Held together by a penalty (`consistency=0.025`,
[methods.md](../methods.md)), all levels stay within 10 cm of level 0. Simulated each on its own they come to
heaps that are up to half a metre from that of level 0.""",
        paper="15, 20 and 21",
        small={"vertices": (100, 130), "height": 0.05, "steps": 40},
        settings={"consistency": 0.025},
        size=(840, 430),
        direct=True,
        moment=5.9,
    ),
    Entry(
        "roll",
        "A sponge roll",
        """Turn lies upon turn, and level 0 cuts their corners: between these, vertices of level 1 are nearer to
the next turn than to their own. Bound to the nearest cell they would move with the wrong turn. pdvol
follows the edges of level 1 instead, and binds all of them to their own turn.""",
        paper="5",
        small={"steps": 12},
        slow=(0.0, 0.35),
        size=(1000, 460),
        moment=0.3,
        further=(
            Further(
                "bound",
                "Which cell each cell is bound to",
                """Each cell of level 1 has the colour of the cell of level 0 it is bound to. Hues go once round along
the sponge, so turns that lie on each other differ. The roll is cut open in its middle. Bound to the nearest
cells, the outer side of a turn has patches in the colour of the turn around it.""",
                cut="z=0",
                size=(1260, 440),
                slow=(0.0, 0.35),
            ),
        ),
    ),
    Entry(
        "bodies_at_rest",
        "Sixty toys on a shelf",
        """Sixty toys land on the boards of a shelf, rock for a while, and lie still for ten seconds. Friction is
smoothed, so what it holds creeps; the page says how fast.""",
        small={"count": 6, "dt": 0.02, "steps": 200},
        slow=(0.0, 0.4),
        size=(1240, 480),
        moment=12.0,
    ),
)
