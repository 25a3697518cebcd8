"""The networks: ACT as in LeRobot, and a flow-matching head on the same encoder.

The parameters have the names of LeRobot 0.4's `ACT`, so that weights can be exchanged. Word
vectors and the flow head, which LeRobot lacks, have other names.
"""

import functools
import math
from dataclasses import asdict, dataclass, replace

import torch
import torch.nn.functional as F
from torch import nn

STATE_TOKEN = 1  # index of the robot's state among the encoder's tokens


@dataclass
class Shape:
    """Sizes of a network; the defaults are those of the shipped policy."""

    kind: str = "act"  # act, or flow
    state: int = 27
    action: int = 12
    chunk: int = 20
    cameras: int = 2
    words: int = 0  # size of the vocabulary with the unknown word; 0: no language
    word_width: int = 300  # size of the sentence vector, and of a word vector without text_layers
    text_layers: int = 0  # layers of the transformer over the words in order; 0: mean of the word vectors
    text_width: int = 100  # size of a word vector, with text_layers
    text_dim: int = 96
    text_heads: int = 4
    width: int = 64  # channels of ResNet18's first stage
    film: bool = False  # words scale and shift the output of each stage of the ResNet
    norm: str = "group"  # group, frozen-bn, or during training batch, which is served as frozen-bn
    group_channels: int = 16  # channels of a group of a group norm
    dim: int = 256
    feedforward: int = 1024
    heads: int = 8
    encoder_layers: int = 4
    decoder_layers: int = 1
    vae_layers: int = 4
    latent: int = 32
    dropout: float = 0.1
    flow_layers: int = 6
    flow_steps: int = 10

    def to_dict(self):
        return asdict(self)

    def to_served_dict(self):
        """As `to_dict`, for a network after its training."""
        return {**self.to_dict(), "norm": "frozen-bn" if self.norm == "batch" else self.norm}


class FrozenNorm(nn.Module):
    """Batch norm with constant statistics, as in torchvision's FrozenBatchNorm2d."""

    def __init__(self, channels):
        super().__init__()
        for name, value in [("weight", 1.0), ("bias", 0.0), ("running_mean", 0.0), ("running_var", 1.0)]:
            self.register_buffer(name, torch.full((channels,), value))

    def forward(self, x):
        scale = self.weight * (self.running_var + 1e-5).rsqrt()
        shift = self.bias - self.running_mean * scale
        return x * scale[:, None, None] + shift[:, None, None]


def make_norm(shape, channels):
    if shape.norm == "frozen-bn":
        return FrozenNorm(channels)
    if shape.norm == "batch":
        return nn.BatchNorm2d(channels)
    if shape.norm != "group":
        raise ValueError(f"unknown norm {shape.norm!r}; available: group, batch, frozen-bn")
    if channels % shape.group_channels:
        raise ValueError(
            f"{channels} channels are not a multiple of the {shape.group_channels} of a group: "
            "change --width or --group-channels"
        )
    return nn.GroupNorm(channels // shape.group_channels, channels)


class Block(nn.Module):
    """ResNet's basic block, with the names of torchvision."""

    def __init__(self, shape, inputs, outputs, stride):
        super().__init__()
        self.conv1 = nn.Conv2d(inputs, outputs, 3, stride, 1, bias=False)
        self.bn1 = make_norm(shape, outputs)
        self.conv2 = nn.Conv2d(outputs, outputs, 3, 1, 1, bias=False)
        self.bn2 = make_norm(shape, outputs)
        self.downsample = None
        if stride != 1 or inputs != outputs:
            self.downsample = nn.Sequential(
                nn.Conv2d(inputs, outputs, 1, stride, bias=False), make_norm(shape, outputs)
            )

    def forward(self, x):
        y = F.relu(self.bn1(self.conv1(x)))
        y = self.bn2(self.conv2(y))
        return F.relu(y + (x if self.downsample is None else self.downsample(x)))


class ResNet18(nn.Module):
    """[N, 3, H, W] to [N, 8 width, H/32, W/32]."""

    def __init__(self, shape):
        super().__init__()
        width = shape.width
        self.conv1 = nn.Conv2d(3, width, 7, 2, 3, bias=False)
        self.bn1 = make_norm(shape, width)
        inputs = width
        for stage in range(4):
            outputs = width << stage
            stride = 1 if stage == 0 else 2
            blocks = [Block(shape, inputs, outputs, stride), Block(shape, outputs, outputs, 1)]
            setattr(self, f"layer{stage + 1}", nn.Sequential(*blocks))
            inputs = outputs
        for module in self.modules():
            if isinstance(module, nn.Conv2d):
                nn.init.kaiming_normal_(module.weight, mode="fan_out", nonlinearity="relu")

    def forward(self, x, film=None):
        """`film`: for each stage [N, 2 channels], scales minus 1, and shifts."""
        x = F.max_pool2d(F.relu(self.bn1(self.conv1(x))), 3, 2, 1)
        for number, stage in enumerate((self.layer1, self.layer2, self.layer3, self.layer4)):
            x = stage(x)
            if film is not None:
                scale, shift = film[number][..., None, None].chunk(2, 1)
                x = x * (1 + scale) + shift
        return x


class Attention(nn.Module):
    """`nn.MultiheadAttention` with the same names, for [batch, tokens, dim]."""

    def __init__(self, dim, heads, dropout):
        super().__init__()
        self.heads, self.dropout = heads, dropout
        self.in_proj_weight = nn.Parameter(torch.empty(3 * dim, dim))
        self.in_proj_bias = nn.Parameter(torch.zeros(3 * dim))
        self.out_proj = nn.Linear(dim, dim)
        nn.init.xavier_uniform_(self.in_proj_weight)
        nn.init.zeros_(self.out_proj.bias)

    def forward(self, query, key, value, allowed=None):
        """`allowed`: [batch, keys], false for masked keys."""
        weights, biases = self.in_proj_weight.chunk(3), self.in_proj_bias.chunk(3)
        q, k, v = (
            F.linear(x, w, b).unflatten(-1, (self.heads, -1)).transpose(1, 2)
            for x, w, b in zip((query, key, value), weights, biases)
        )
        mask = None if allowed is None else allowed[:, None, None, :]
        dropout = self.dropout if self.training else 0.0
        out = F.scaled_dot_product_attention(q, k, v, attn_mask=mask, dropout_p=dropout)
        return self.out_proj(out.transpose(1, 2).flatten(2))


class EncoderLayer(nn.Module):
    def __init__(self, shape):
        super().__init__()
        dim = shape.dim
        self.self_attn = Attention(dim, shape.heads, shape.dropout)
        self.linear1 = nn.Linear(dim, shape.feedforward)
        self.linear2 = nn.Linear(shape.feedforward, dim)
        self.norm1, self.norm2 = nn.LayerNorm(dim), nn.LayerNorm(dim)
        self.dropout = nn.Dropout(shape.dropout)

    def forward(self, x, position, allowed=None):
        placed = x + position
        x = self.norm1(x + self.dropout(self.self_attn(placed, placed, x, allowed)))
        y = self.linear2(self.dropout(F.relu(self.linear1(x))))
        return self.norm2(x + self.dropout(y))


class Encoder(nn.Module):
    def __init__(self, shape, count):
        super().__init__()
        self.layers = nn.ModuleList(EncoderLayer(shape) for _ in range(count))

    def forward(self, x, position, allowed=None):
        for layer in self.layers:
            x = layer(x, position, allowed)
        return x


class DecoderLayer(nn.Module):
    def __init__(self, shape):
        super().__init__()
        dim = shape.dim
        self.self_attn = Attention(dim, shape.heads, shape.dropout)
        self.multihead_attn = Attention(dim, shape.heads, shape.dropout)
        self.linear1 = nn.Linear(dim, shape.feedforward)
        self.linear2 = nn.Linear(shape.feedforward, dim)
        self.norm1, self.norm2, self.norm3 = nn.LayerNorm(dim), nn.LayerNorm(dim), nn.LayerNorm(dim)
        self.dropout = nn.Dropout(shape.dropout)

    def forward(self, x, memory, place, memory_place):
        placed = x + place
        x = self.norm1(x + self.dropout(self.self_attn(placed, placed, x)))
        y = self.multihead_attn(x + place, memory + memory_place, memory)
        x = self.norm2(x + self.dropout(y))
        y = self.linear2(self.dropout(F.relu(self.linear1(x))))
        return self.norm3(x + self.dropout(y))


class Decoder(nn.Module):
    def __init__(self, shape):
        super().__init__()
        self.layers = nn.ModuleList(DecoderLayer(shape) for _ in range(shape.decoder_layers))
        self.norm = nn.LayerNorm(shape.dim)

    def forward(self, x, memory, place, memory_place):
        for layer in self.layers:
            x = layer(x, memory, place, memory_place)
        return self.norm(x)


def sinusoids(count, dim):
    """[count, dim]: alternating sine and cosine, wavelengths from 2 pi to 10000 * 2 pi."""
    place = torch.arange(count, dtype=torch.float64)[:, None]
    rate = 10000 ** (2 * (torch.arange(dim, dtype=torch.float64) // 2) / dim)
    angle = place / rate
    out = torch.empty(count, dim, dtype=torch.float64)
    out[:, 0::2], out[:, 1::2] = angle[:, 0::2].sin(), angle[:, 1::2].cos()
    return out.float()


@functools.lru_cache
def image_positions(height, width, dim, device):
    """[height * width, dim]: half for the row, half for the column, with angles from 1/height and
    1/width of a full turn to one turn."""
    half = dim // 2
    rate = 10000.0 ** (2 * (torch.arange(half, dtype=torch.float32) // 2) / half)

    def along(count):
        at = torch.arange(1, count + 1, dtype=torch.float32)
        angle = (at / (count + 1e-6) * (2 * math.pi))[:, None] / rate
        return torch.stack((angle[:, 0::2].sin(), angle[:, 1::2].cos()), -1).flatten(1)

    rows = along(height)[:, None].expand(height, width, half)
    columns = along(width)[None].expand(height, width, half)
    return torch.cat((rows, columns), -1).flatten(0, 1).to(device)


class Act(nn.Module):
    """Action chunking transformer (Zhao et al. 2023).

    Inputs: images [B, cameras, 3, H, W], normalised; state [B, state], normalised; words [B, L],
    indices padded with -1. Output: actions [B, chunk, action], normalised.
    """

    def __init__(self, shape):
        super().__init__()
        self.shape = shape
        dim = shape.dim
        if shape.kind == "act":
            self.vae_encoder = Encoder(shape, shape.vae_layers)
            self.vae_encoder_cls_embed = nn.Embedding(1, dim)
            self.vae_encoder_robot_state_input_proj = nn.Linear(shape.state, dim)
            self.vae_encoder_action_input_proj = nn.Linear(shape.action, dim)
            self.vae_encoder_latent_output_proj = nn.Linear(dim, 2 * shape.latent)
            places = sinusoids(2 + shape.chunk, dim)[None]
            self.register_buffer("vae_encoder_pos_enc", places)
        self.backbone = ResNet18(shape)
        if shape.film:
            # Feature-wise linear modulation (Perez et al. 2018), initially the identity.
            self.film = nn.ModuleList(nn.Linear(shape.word_width, 2 * (shape.width << stage)) for stage in range(4))
            for layer in self.film:
                nn.init.zeros_(layer.weight)
                nn.init.zeros_(layer.bias)
        self.encoder = Encoder(shape, shape.encoder_layers)
        self.encoder_robot_state_input_proj = nn.Linear(shape.state, dim)
        tokens = 2
        if shape.words:
            self.encoder_env_state_input_proj = nn.Linear(shape.word_width, dim)
            tokens = 3
        self.encoder_latent_input_proj = nn.Linear(shape.latent, dim)
        self.encoder_img_feat_input_proj = nn.Conv2d(8 * shape.width, dim, 1)
        self.encoder_1d_feature_pos_embed = nn.Embedding(tokens, dim)
        if shape.kind == "act":
            self.decoder = Decoder(shape)
            self.decoder_pos_embed = nn.Embedding(shape.chunk, dim)
            self.action_head = nn.Linear(dim, shape.action)
        parts = [self.encoder] + ([self.decoder] if shape.kind == "act" else [])
        for parameter in (p for part in parts for p in part.parameters()):
            if parameter.dim() > 1:
                nn.init.xavier_uniform_(parameter)

    def latent(self, state, actions, is_pad, noise=None):
        """Mean and logarithm of the variance [B, latent], and a sample."""
        shape, batch = self.shape, len(state)
        first = self.vae_encoder_cls_embed.weight.expand(batch, 1, -1)
        state_token = self.vae_encoder_robot_state_input_proj(state)[:, None]
        x = torch.cat((first, state_token, self.vae_encoder_action_input_proj(actions)), 1)
        allowed = F.pad(~is_pad, (2, 0), value=True)
        out = self.vae_encoder(x, self.vae_encoder_pos_enc, allowed)[:, 0]
        mean, log_variance = self.vae_encoder_latent_output_proj(out).split(shape.latent, -1)
        noise = torch.randn_like(mean) if noise is None else noise
        return mean, log_variance, mean + (log_variance / 2).exp() * noise

    def features(self, images, language):
        """Features of the ResNet: [B * cameras, 8 width, H/32, W/32]."""
        film = None
        if self.shape.film:
            film = [layer(language).repeat_interleave(self.shape.cameras, 0) for layer in self.film]
        return self.backbone(images.flatten(0, 1), film)

    def encode(self, images, state, language, latent):
        """Tokens [B, N, dim] and their position embeddings [1, N, dim]."""
        shape, batch = self.shape, len(state)
        tokens = [self.encoder_latent_input_proj(latent), self.encoder_robot_state_input_proj(state)]
        if shape.words:
            tokens.append(self.encoder_env_state_input_proj(language))
        features = self.encoder_img_feat_input_proj(self.features(images, language))
        height, width = features.shape[-2:]
        image_tokens = features.flatten(2).transpose(1, 2).reshape(batch, -1, shape.dim)
        place = image_positions(height, width, shape.dim, image_tokens.device).to(image_tokens.dtype)
        places = torch.cat([self.encoder_1d_feature_pos_embed.weight] + [place] * shape.cameras)[None]
        x = torch.cat((torch.stack(tokens, 1), image_tokens), 1)
        return self.encoder(x, places), places

    def decode(self, memory, places):
        """Actions [B, chunk, action] from the tokens of `encode`."""
        query = memory.new_zeros(len(memory), self.shape.chunk, self.shape.dim)
        place = self.decoder_pos_embed.weight[None]
        return self.action_head(self.decoder(query, memory, place, places))

    def forward(self, images, state, language=None, actions=None, is_pad=None, noise=None):
        """Actions; mean and logarithm of the variance of the latent with `actions` (in training),
        else None; the encoder's tokens [B, N, dim]."""
        mean = log_variance = None
        if actions is None:
            latent = state.new_zeros(len(state), self.shape.latent)
        else:
            mean, log_variance, latent = self.latent(state, actions, is_pad, noise)
        memory, places = self.encode(images, state, language, latent)
        return self.decode(memory, places), mean, log_variance, memory


class FlowBlock(nn.Module):
    """A layer of the diffusion transformer (Peebles and Xie 2023) with cross attention; all layers
    share the modulation by time, each with its own bias (Chen et al. 2023, PixArt)."""

    def __init__(self, shape):
        super().__init__()
        dim = shape.dim
        self.self_attn = Attention(dim, shape.heads, 0.0)
        self.cross_attn = Attention(dim, shape.heads, 0.0)
        self.linear1 = nn.Linear(dim, shape.feedforward)
        self.linear2 = nn.Linear(shape.feedforward, dim)
        self.table = nn.Parameter(torch.randn(9, dim) / dim**0.5)

    def forward(self, x, memory, key, modulation):
        """`modulation`: [B, 9, dim], shift, scale and gate of the three parts."""
        m = (modulation + self.table)[:, :, None].unbind(1)

        def norm(x, k):
            return F.layer_norm(x, x.shape[-1:]) * (1 + m[k + 1]) + m[k]

        y = norm(x, 0)
        x = x + m[2] * self.self_attn(y, y, y)
        x = x + m[5] * self.cross_attn(norm(x, 3), key, memory)
        y = self.linear2(F.gelu(self.linear1(norm(x, 6)), approximate="tanh"))
        return x + m[8] * y


class Flow(nn.Module):
    """Velocity of actions from noise at time 0 to data at time 1 (Lipman et al. 2023)."""

    def __init__(self, shape):
        super().__init__()
        dim = shape.dim
        self.action_in = nn.Linear(shape.action, dim)
        self.place = nn.Embedding(shape.chunk, dim)
        self.time1, self.time2 = nn.Linear(dim, dim), nn.Linear(dim, dim)
        self.told = nn.Linear(dim, 9 * dim)  # a key of policy files
        self.layers = nn.ModuleList(FlowBlock(shape) for _ in range(shape.flow_layers))
        self.norm = nn.LayerNorm(dim)
        self.action_out = nn.Linear(dim, shape.action)
        nn.init.zeros_(self.told.weight)
        nn.init.zeros_(self.told.bias)
        nn.init.zeros_(self.action_out.weight)
        nn.init.zeros_(self.action_out.bias)
        half = dim // 2
        rates = torch.exp(torch.arange(half, dtype=torch.float32) * (-math.log(1e4) / half))
        self.register_buffer("rates", rates, persistent=False)

    def forward(self, actions, time, memory, key):
        """Velocity [B, chunk, action]; `time` [B], 0 to 1."""
        angle = 1000 * time[:, None] * self.rates
        modulation = self.time2(F.silu(self.time1(torch.cat((angle.cos(), angle.sin()), -1))))
        modulation = self.told(F.silu(modulation)).unflatten(-1, (9, -1))
        x = self.action_in(actions) + self.place.weight
        for layer in self.layers:
            x = layer(x, memory, key, modulation)
        return self.action_out(self.norm(x))


# Words of a sentence that a text encoder reads: its cost grows with their square, and
# instructions have no maximum length.
MAX_WORDS = 128


class TextEncoder(nn.Module):
    """Encodes words in order: vectors [B, L, text_width] to [B, word_width]."""

    def __init__(self, shape):
        super().__init__()
        dim = shape.text_dim
        self.input = nn.Linear(shape.text_width, dim)
        layers = replace(shape, dim=dim, heads=shape.text_heads, feedforward=4 * dim)
        self.encoder = Encoder(layers, shape.text_layers)
        self.output = nn.Linear(dim, shape.word_width)

    def forward(self, vectors, known):
        """`known`: [B, L], false after the end of a sentence."""
        x = self.input(vectors)
        # An empty sentence is one word with the vector 0.
        first = torch.arange(known.shape[1], device=known.device) == 0
        known = known | (first & ~known.any(1, keepdim=True))
        x = self.encoder(x, sinusoids(*x.shape[1:]).to(x)[None], known)
        counts = known[..., None].to(x.dtype)
        return self.output((x * counts).sum(1) / counts.sum(1))


class Policy(nn.Module):
    """The complete network with its word vectors."""

    def __init__(self, shape):
        super().__init__()
        if shape.film and not shape.words:
            raise ValueError("--film needs words: leave --no-language out")
        if shape.text_layers and not shape.words:
            raise ValueError("text_layers need words: set `words` to the size of the vocabulary")
        self.shape = shape
        self.model = Act(shape)
        if shape.kind == "flow":
            self.flow = Flow(shape)
        elif shape.kind != "act":
            raise ValueError(f"unknown kind of network {shape.kind!r}; available: act, flow")
        if shape.words:
            self.words = nn.Embedding(shape.words, shape.text_width if shape.text_layers else shape.word_width)
        if shape.text_layers:
            self.text = TextEncoder(shape)

    def language(self, words):
        """Sentence vectors [B, word_width] from word indices [B, L], padded with -1."""
        if not self.shape.words:
            return None
        if self.shape.text_layers:
            words = words[:, :MAX_WORDS]
        known = (words >= 0)[..., None]
        vectors = self.words(words.clamp(min=0)) * known
        if self.shape.text_layers:
            return self.text(vectors, known[..., 0])
        return vectors.sum(1) / known.sum(1).clamp(min=1)

    def loss(self, images, state, words, actions, is_pad, kl_weight):
        """The loss, its parts by name, and the encoder's tokens. Padding has the error 0, as in
        LeRobot; rows of only padding do not count."""
        language = self.language(words)
        if self.shape.kind == "act":
            found, mean, log_variance, memory = self.model(images, state, language, actions, is_pad)
            counts = (~is_pad.all(1)).float()
            share = counts.mean().clamp(min=1 / len(counts))
            l1 = ((found - actions).abs() * ~is_pad[..., None]).mean() / share
            kl = ((-0.5 * (1 + log_variance - mean**2 - log_variance.exp())).sum(-1) * counts).mean() / share
            return l1 + kl_weight * kl, {"l1": l1, "kl": kl}, memory
        memory, key = self.memory(images, state, language)
        noise = torch.randn_like(actions)
        # Times near the noise are sampled more often, as in pi0 (Black et al. 2024).
        time = 1 - 0.999 * torch.rand(len(state), device=state.device) ** (1 / 1.5)
        at = time[:, None, None]
        found = self.flow(at * actions + (1 - at) * noise, time, memory, key)
        share = (~is_pad.all(1)).float().mean().clamp(min=1 / len(is_pad))
        square = ((found - (actions - noise)) ** 2 * ~is_pad[..., None]).mean() / share
        return square, {"flow": square}, memory

    def memory(self, images, state, language):
        latent = state.new_zeros(len(state), self.shape.latent)
        memory, places = self.model.encode(images, state, language, latent)
        return memory, memory + places

    def forward(self, images, state, words=None, noise=None):
        """Actions [B, chunk, action], normalised. A flow starts from `noise` of this shape, which
        is sampled if absent."""
        return self.predict(images, state, words, noise)[0]

    def predict(self, images, state, words=None, noise=None):
        """As `forward`, and the encoder's tokens [B, N, dim]."""
        language = self.language(words)
        if self.shape.kind == "act":
            actions, *_, memory = self.model(images, state, language)
            return actions, memory
        memory, key = self.memory(images, state, language)
        if noise is None:
            noise = torch.randn(len(state), self.shape.chunk, self.shape.action, device=state.device)
        x, steps = noise, self.shape.flow_steps
        for step in range(steps):
            time = state.new_full((len(state),), step / steps)
            x = x + self.flow(x, time, memory, key) / steps
        return x, memory
