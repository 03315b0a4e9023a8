"""`diffusion_transformer`: a transformer that denoises action chunks, given cameras, state and an instruction."""
