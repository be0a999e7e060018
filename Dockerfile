# The README's installation in a container of Debian:
#   docker build -t hopping-leg .
#   docker run --rm --network host hopping-leg            (then open the printed address)
#   docker run --rm -v "$PWD/runs:/hopping-leg/runs" hopping-leg evaluate fast --out runs/first
FROM debian:bookworm-slim
RUN apt-get update \
 && apt-get install -y --no-install-recommends ca-certificates git make python3.11-venv \
 && rm -rf /var/lib/apt/lists/*
WORKDIR /hopping-leg
COPY . .
RUN make install
ENV PATH="/hopping-leg/.venv/bin:$PATH"
ENTRYPOINT ["hop"]
CMD ["demo", "--no-browser"]
