"""Every particle with a list of all its poses."""


class FullHistory:
    def __init__(self, particles):
        self.paths = [[] for _ in range(particles)]

    def append(self, poses, parents):
        self.paths = [[*self.paths[parents[k]], poses[k]] for k in range(len(poses))]
