"""Every particle with a full copy of everything: what sharing tiles must not be told from."""

import copy


class OwnCopies:
    """maps[particle]: what it holds, by place; snapshots: what particles held when they were taken."""

    def __init__(self, particles):
        self.maps = [{} for _ in range(particles)]
        self.snapshots = []

    def write(self, particle, place, content):
        self.maps[particle][place] = content

    def resample(self, ancestors):
        self.maps = [copy.deepcopy(self.maps[ancestor]) for ancestor in ancestors]

    def take(self, particle):
        self.snapshots.append(copy.deepcopy(self.maps[particle]))


def recount(tables, held_otherwise, capacity):
    """Owners of each tile: every page table that names it and every other holder."""
    counts = [0] * capacity
    for table in [*tables, *held_otherwise]:
        for tile in table.ravel():
            if tile >= 0:
                counts[tile] += 1
    return counts
