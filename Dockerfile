# Debian 12 with the package built in it: docs/installing.md.
FROM debian:12
WORKDIR /opt/rbpf_svgp_slam
COPY . .
RUN apt-get update && apt-get install -y --no-install-recommends ca-certificates \
    && tools/setup.sh \
    && apt-get clean && rm -rf /var/lib/apt/lists/*
ENTRYPOINT ["bash", "-c", ". /opt/rbpf_svgp_slam/build/devel/setup.bash && exec \"$@\"", "--"]
CMD ["bash"]
