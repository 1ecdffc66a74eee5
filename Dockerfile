# The image that compiles; any with Rust 1.94 or later, and a libc that is not newer than that of the second stage.
ARG BUILDER=rust:1.95-slim-bookworm
ARG BASE=debian:bookworm-slim

# Build: the whole workspace, since Cargo wants every manifest; only the binary goes on. What Cargo downloads and compiles
# stays in the builder's caches, so that the next build compiles what has changed (BuildKit, which Docker 23 and later
# build with, or buildah).
FROM ${BUILDER} AS build
RUN command -v cc >/dev/null && command -v strip >/dev/null || \
    { apt-get update && apt-get install -y --no-install-recommends gcc libc6-dev binutils && rm -rf /var/lib/apt/lists/*; }
WORKDIR /signorini
COPY . .
# the names of functions would be a fifth of it; a panic still tells its file and line
RUN --mount=type=cache,target=/usr/local/cargo/registry --mount=type=cache,target=/signorini/target \
    cargo build --release --locked --bin signorini && \
    cp target/release/signorini /usr/local/bin/signorini && strip /usr/local/bin/signorini

# Run: glibc and the binary, nothing else; not as root.
FROM ${BASE}
# as a number, so that Kubernetes can see that it is not root (runAsNonRoot); the owner of what is in the volume
RUN groupadd --system --gid 999 signorini && \
    useradd --system --uid 999 --gid 999 --home-dir /data --create-home signorini
COPY --from=build /usr/local/bin/signorini /usr/local/bin/signorini
USER 999:999
VOLUME /data
EXPOSE 8080
# A container's own loopback reaches nobody: listen on all its interfaces, publish with -p. It starts only with a token in
# /data, a trusted proxy or --allow-unauthenticated.
ENV SIGNORINI_LISTEN=0.0.0.0:8080 SIGNORINI_DATA=/data
HEALTHCHECK --interval=30s --timeout=6s --start-period=60s --retries=3 CMD ["signorini", "health"]
# exec form, so that SIGTERM reaches the server and it stops gracefully
ENTRYPOINT ["signorini"]
CMD ["serve"]
# last, so that another version changes no layer
ARG VERSION=development
LABEL org.opencontainers.image.title="Signorini" \
      org.opencontainers.image.description="A service that solves frictional contact problems by finite elements" \
      org.opencontainers.image.licenses="MIT OR Apache-2.0" \
      org.opencontainers.image.version="${VERSION}"
