// Cells of the network's layers, [channel][x][y][z], and its weights in half precision.

uint cell_count() { return layer.n_x * layer.n_y * layer.n_z; }

uvec3 cell_at(uint cell) {
    return uvec3(cell / (layer.n_z * layer.n_y), cell / layer.n_z % layer.n_y, cell % layer.n_z);
}

float silu(float x) { return x / (1.0 + exp(-x)); }
