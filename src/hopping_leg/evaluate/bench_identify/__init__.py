"""Benchmark of identification: known twins, throughput, the paper's size, others, real data."""
