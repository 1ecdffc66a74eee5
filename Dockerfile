# Build: the whole workspace, since Cargo wants every manifest; only the binary goes on.
FROM rust:1.95-slim-bookworm AS build
RUN apt-get update && apt-get install -y --no-install-recommends gcc libc6-dev && rm -rf /var/lib/apt/lists/*
WORKDIR /signorini
COPY . .
RUN cargo build --release --locked --bin signorini

# Run: glibc and the binary, nothing else; not as root.
FROM debian:bookworm-slim
RUN useradd --system --home-dir /data --create-home signorini
COPY --from=build /signorini/target/release/signorini /usr/local/bin/signorini
USER signorini
VOLUME /data
EXPOSE 8080
# A container's own loopback reaches nobody: listen on all its interfaces, publish with -p.
ENV SIGNORINI_LISTEN=0.0.0.0:8080 SIGNORINI_DATA=/data
# exec form, so that SIGTERM reaches the server and it stops gracefully
ENTRYPOINT ["signorini"]
CMD ["serve"]
