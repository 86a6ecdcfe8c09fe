# Plans without an installation:
#   docker build -t guided-lgp .
#   docker run --rm -v "$PWD":/work guided-lgp plan scene.json --goal "(on red green)"
FROM python:3.11-slim

RUN apt-get update \
    && apt-get install -y --no-install-recommends gcc libc6-dev \
    && rm -rf /var/lib/apt/lists/*
COPY pyproject.toml README.md LICENSE /source/
COPY src /source/src
RUN pip install --no-cache-dir '/source[view,ros]' && rm -r /source

ENV XDG_CACHE_HOME=/cache
# The first plan compiles the solver: done here, so that it is in the image for every user.
RUN guided-lgp examples /tmp/examples \
    && guided-lgp plan /tmp/examples/three_boxes.json --goal "(held red)" \
    && rm -r /tmp/examples \
    && chmod -R a+rwX /cache
WORKDIR /work
ENTRYPOINT ["guided-lgp"]
